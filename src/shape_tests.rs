use super::*;

fn v2(x: f64, y: f64) -> Vector<2> {
    Vector::from([x, y])
}

fn v3(x: f64, y: f64, z: f64) -> Vector<3> {
    Vector::from([x, y, z])
}

fn slit() -> Shape<2> {
    Shape::Box {
        min: v2(-0.1, -1.0 / 120.0),
        max: v2(0.1, 1.0 / 120.0),
    }
}

/// The same slit as a polygon, hence by the general path.
fn slit_polygon() -> Shape<2> {
    let h = 1.0 / 120.0;
    Shape::Polygon(vec![v2(-0.1, -h), v2(0.1, -h), v2(0.1, h), v2(-0.1, h)])
}

/// The same slit in two halves that share the face x = 0.
fn slit_halves() -> Shape<2> {
    let h = 1.0 / 120.0;
    let half = |a: f64, b: f64| Shape::Box {
        min: v2(a, -h),
        max: v2(b, h),
    };
    Shape::Union(vec![half(-0.1, 0.0), half(0.0, 0.1)])
}

#[test]
fn distances_by_hand() {
    let unit = Shape::Box {
        min: v2(0.0, 0.0),
        max: v2(2.0, 1.0),
    };
    for (x, d) in [
        (v2(1.0, 0.5), -0.5),
        (v2(1.9, 0.5), -0.1),
        (v2(3.0, 0.5), 1.0),
        (v2(5.0, 5.0), 5.0),
        (v2(2.0, 0.3), 0.0),
    ] {
        assert!((unit.signed_distance(&x) - d).abs() < 1e-15);
    }
    let ball = Shape::Ball {
        center: v3(1.0, 0.0, 0.0),
        radius: 2.0,
    };
    assert_eq!(ball.signed_distance(&v3(1.0, 3.0, 4.0)), 3.0);
    assert_eq!(ball.signed_distance(&v3(1.0, 0.0, 0.0)), -2.0);
    let bend = Shape::Polyline(vec![v2(0.0, 0.0), v2(1.0, 0.0), v2(1.0, 1.0)]);
    assert_eq!(bend.signed_distance(&v2(0.5, -0.25)), 0.25);
    assert_eq!(bend.signed_distance(&v2(4.0, 5.0)), 5.0);
    let triangle = Shape::Polygon(vec![v2(0.0, 0.0), v2(4.0, 0.0), v2(0.0, 3.0)]);
    assert!((triangle.signed_distance(&v2(1.0, 1.0)) + 1.0).abs() < 1e-15); // its incircle has radius 1
    assert_eq!(triangle.signed_distance(&v2(-3.0, -4.0)), 5.0);
    let disc = Shape::Polygon(vec![
        v3(0.0, 0.0, 1.0),
        v3(1.0, 0.0, 1.0),
        v3(1.0, 1.0, 1.0),
        v3(0.0, 1.0, 1.0),
    ]);
    assert_eq!(disc.signed_distance(&v3(0.5, 0.5, -2.0)), 3.0);
    assert_eq!(disc.signed_distance(&v3(4.0, 0.5, 5.0)), 5.0);
}

#[test]
fn union_and_difference() {
    let frame = Shape::Without {
        from: Box::new(Shape::Box {
            min: v2(-2.0, -2.0),
            max: v2(2.0, 2.0),
        }),
        removed: Box::new(Shape::Ball {
            center: v2(0.0, 0.0),
            radius: 1.0,
        }),
    };
    assert!(frame.contains(&v2(1.0, 0.0), 0.0) && frame.contains(&v2(2.0, 2.0), 0.0));
    assert!(!frame.contains(&v2(0.5, 0.0), 1e-9) && !frame.contains(&v2(2.1, 0.0), 1e-9));
    assert_eq!(frame.bounds(), (v2(-2.0, -2.0), v2(2.0, 2.0)));
    assert!(slit_halves().contains(&v2(0.0, 0.0), 0.0));
    assert!(Shape::<3>::Everywhere.contains(&v3(1e9, 0.0, 0.0), 0.0));
    assert!(!Shape::<3>::Union(vec![]).contains(&v3(0.0, 0.0, 0.0), 1e300));
}

#[test]
fn a_void_cuts_what_passes_through_it() {
    let h = 1.0 / 120.0;
    for shape in [slit(), slit_polygon(), slit_halves()] {
        let void = Barrier::Void(shape);
        let cut = |a: Vector<2>, b: Vector<2>| {
            assert_eq!(void.cuts(&a, &b), void.cuts(&b, &a));
            void.cuts(&a, &b)
        };
        assert!(cut(v2(0.0, h), v2(0.0, -h)), "between opposite faces");
        assert!(cut(v2(0.05, 3.0 * h), v2(0.03, -2.0 * h)), "across");
        assert!(cut(v2(-0.2, 0.0), v2(0.2, 0.0)), "lengthways");
        assert!(
            cut(v2(0.1, 0.0), v2(0.09, 0.01)),
            "from the end face to the top"
        );
        assert!(
            cut(v2(0.1, -h), v2(0.1 - 2.0 * h, h)),
            "from corner to face"
        );
        assert!(!cut(v2(0.0, h), v2(0.05, h)), "along the top face");
        assert!(!cut(v2(0.0, h - 1e-17), v2(0.05, h)), "along it, rounded");
        assert!(!cut(v2(0.1, -h), v2(0.1, h)), "along the end face");
        assert!(
            !cut(v2(0.1 - h, 2.0 * h), v2(0.1 + h, 0.0)),
            "touching the corner"
        );
        assert!(
            !cut(v2(0.0, h), v2(0.0, 2.0 * h)),
            "leaving the face outwards"
        );
        assert!(!cut(v2(0.2, -h), v2(0.2, h)), "beyond the tip");
    }
}

#[test]
fn round_and_solid_voids() {
    let ball = Barrier::Void(Shape::Ball {
        center: v3(0.0, 0.0, 0.0),
        radius: 1.0,
    });
    assert!(ball.cuts(&v3(-2.0, 0.5, 0.0), &v3(2.0, 0.5, 0.0)));
    assert!(!ball.cuts(&v3(-2.0, 1.0, 0.0), &v3(2.0, 1.0, 0.0)));
    assert!(!ball.cuts(&v3(1.0, 0.0, 0.0), &v3(2.0, 0.0, 0.0)));
    assert!(ball.cuts(&v3(1.0, 0.0, 0.0), &v3(0.0, 1.0, 0.0)));
    let frame = Barrier::Void(Shape::Without {
        from: Box::new(Shape::Box {
            min: v3(-2.0, -2.0, -2.0),
            max: v3(2.0, 2.0, 2.0),
        }),
        removed: Box::new(Shape::Ball {
            center: v3(0.0, 0.0, 0.0),
            radius: 1.0,
        }),
    });
    assert!(!frame.cuts(&v3(-0.5, 0.0, 0.0), &v3(0.9, 0.0, 0.0)));
    assert!(frame.cuts(&v3(-0.5, 0.0, 0.0), &v3(1.1, 0.0, 0.0)));
    let flat = Barrier::Void(Shape::Segment {
        a: v2(-1.0, 0.0),
        b: v2(1.0, 0.0),
    });
    assert!(!flat.cuts(&v2(0.0, -1.0), &v2(0.0, 1.0)));
}

/// Against sampling: random boxes, balls and triangles, random bonds, a thousand samples each.
#[test]
fn voids_agree_with_sampling() {
    let mut state = 17u64;
    let mut random = || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 33) as f64 / (1u64 << 31) as f64
    };
    let mut cut_count = 0;
    for round in 0..600 {
        let p: Vec<Vector<2>> = (0..5).map(|_| v2(random(), random())).collect();
        let shape = match round % 3 {
            0 => Shape::Box {
                min: p[0].inf(&p[1]),
                max: p[0].sup(&p[1]),
            },
            1 => Shape::Ball {
                center: p[0],
                radius: 0.3 * p[1].x,
            },
            _ => Shape::Polygon(vec![p[0], p[1], p[2]]),
        };
        let (a, b) = (p[3], p[4]);
        let samples = 1000;
        let deepest = (0..=samples)
            .map(|i| shape.signed_distance(&(a + (b - a) * (f64::from(i) / f64::from(samples)))))
            .fold(f64::INFINITY, f64::min);
        // a sample may miss a corner by half a step
        let step = (b - a).norm() / f64::from(samples);
        if deepest.abs() > step {
            assert_eq!(
                Barrier::Void(shape.clone()).cuts(&a, &b),
                deepest < 0.0,
                "{shape:?}"
            );
            cut_count += usize::from(deepest < 0.0);
        }
    }
    assert!(cut_count > 100);
}

#[test]
fn cracks_part_their_sides() {
    let crack = Barrier::Crack(Shape::Polyline(vec![
        v2(-1.0, 0.0),
        v2(0.0, 0.0),
        v2(1.0, 1.0),
    ]));
    assert!(crack.cuts(&v2(-0.5, -0.1), &v2(-0.5, 0.1)));
    assert!(crack.cuts(&v2(0.5, 0.4), &v2(0.5, 0.6)));
    assert!(
        crack.cuts(&v2(0.0, -0.1), &v2(0.0, 0.1)),
        "through the bend"
    );
    assert!(crack.cuts(&v2(1.1, 0.9), &v2(0.9, 1.1)), "through the tip");
    assert!(!crack.cuts(&v2(1.2, 1.0), &v2(1.0, 1.2)), "beyond the tip");
    assert!(
        !crack.cuts(&v2(-0.5, 0.0), &v2(-0.5, 0.1)),
        "a point on it is above it"
    );
    assert!(crack.cuts(&v2(-0.5, 1e-14), &v2(-0.5, -0.1)));
    assert!(
        crack.cuts(&v2(-0.5, -1e-14), &v2(-0.5, -0.1)),
        "rounding does not matter"
    );
    assert!(!crack.cuts(&v2(-0.9, 0.0), &v2(-0.2, 0.0)), "along it");

    let point = Barrier::Crack(Shape::Segment {
        a: Vector::<1>::from([0.3]),
        b: Vector::<1>::from([0.3]),
    });
    let x = |x: f64| Vector::<1>::from([x]);
    assert!(point.cuts(&x(0.2), &x(0.4)) && point.cuts(&x(0.3), &x(0.2)));
    assert!(!point.cuts(&x(0.3), &x(0.4)) && !point.cuts(&x(0.4), &x(0.5)));

    let corners = vec![
        v3(0.0, 0.0, 0.0),
        v3(1.0, 0.0, 0.0),
        v3(1.0, 1.0, 1.0),
        v3(0.0, 1.0, 1.0),
    ];
    let plane = Barrier::Crack(Shape::Polygon(corners));
    assert!(plane.cuts(&v3(0.5, 0.5, 0.4), &v3(0.5, 0.5, 0.6)));
    assert!(
        !plane.cuts(&v3(0.5, 0.5, 0.5), &v3(0.5, 0.4, 0.6)),
        "the positive side"
    );
    assert!(plane.cuts(&v3(0.5, 0.5, 0.5), &v3(0.5, 0.6, 0.4)));
    assert!(
        !plane.cuts(&v3(1.5, 0.5, 0.4), &v3(1.5, 0.5, 0.6)),
        "beside it"
    );
    assert!(
        plane.cuts(&v3(0.0, 0.5, 0.4), &v3(0.0, 0.5, 0.6)),
        "through its rim"
    );
    let flat = Barrier::Crack(Shape::Box {
        min: v3(0.0, 0.0, 0.5),
        max: v3(1.0, 1.0, 0.5),
    });
    assert!(flat.cuts(&v3(0.5, 0.5, 0.4), &v3(0.7, 0.5, 0.6)));
    assert!(!flat.cuts(&v3(0.9, 0.5, 0.4), &v3(1.3, 0.5, 0.6)));
}

#[test]
fn prefilter_agrees_with_the_barriers() {
    let members = vec![
        Barrier::Void(slit()),
        Barrier::Crack(Shape::Segment {
            a: v2(0.3, -0.2),
            b: v2(0.3, 0.2),
        }),
    ];
    let all = Barriers::new(members.clone());
    let h = 1.0 / 40.0;
    let mut count = 0;
    for i in -20..20 {
        for j in -20..20 {
            let a = v2(f64::from(i) * h, f64::from(j) * h);
            for (k, l) in [(1, 0), (0, 1), (2, 1), (-1, 3), (3, 3)] {
                let b = a + v2(f64::from(k) * h, f64::from(l) * h);
                let slow = members.iter().any(|m| m.cuts(&a, &b));
                assert_eq!(all.cuts(&a, &b), slow);
                assert!(!slow || all.near(&a, (b - a).norm()));
                count += usize::from(slow);
            }
        }
    }
    assert!(count > 50 && !all.near(&v2(-0.4, 0.4), 0.1) && !all.is_empty());
}
