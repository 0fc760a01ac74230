//! The horizons of points: one of all, one of each lattice, or one of each point.

/// Horizons δ of some points \[m\].
#[derive(Clone, Debug, PartialEq)]
pub enum Horizon {
    /// All points have one.
    Uniform(f64),
    /// The points are those of several lattices.
    PerLattice {
        /// The horizon of each lattice.
        horizons: Vec<f64>,
        /// The lattice of each point.
        of_point: Vec<u16>,
    },
    /// Each point has its own.
    Field(Vec<f64>),
}

/// Horizon of a bond whose ends have different ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BondHorizon {
    /// That of the family's centre, from either end.
    #[default]
    OfCentre,
    /// The larger of both.
    Larger,
}

impl BondHorizon {
    /// Of the bond between two points, seen from the first.
    pub fn of(self, [i, j]: [usize; 2], horizon: &Horizon) -> f64 {
        match self {
            Self::OfCentre => horizon.of(i),
            Self::Larger => horizon.of(i).max(horizon.of(j)),
        }
    }
}

/// Horizons that differ by less than this of their size are one.
const SAME: f64 = 1e-12;

impl Default for Horizon {
    /// That of no points.
    fn default() -> Self {
        Self::Uniform(0.0)
    }
}

impl Horizon {
    /// Of a field at each point; uniform if the field is.
    pub fn of_field(values: Vec<f64>) -> Self {
        match values.first() {
            Some(&first) if values.iter().all(|d| (d - first).abs() <= SAME * d) => {
                Self::Uniform(first)
            }
            _ => Self::Field(values),
        }
    }

    /// The same horizons by the different ones, in rising order, of which each is named once; as they are if they are too many to number.
    #[must_use]
    pub fn grouped(self) -> Self {
        let Self::Field(values) = self else {
            return self;
        };
        let mut horizons = values.clone();
        horizons.sort_by(f64::total_cmp);
        horizons.dedup();
        if horizons.len() > usize::from(u16::MAX) {
            return Self::Field(values);
        }
        let place = |v: &f64| horizons.partition_point(|h| h < v) as u16;
        Self::PerLattice {
            of_point: values.iter().map(place).collect(),
            horizons,
        }
    }

    /// Of a point.
    pub fn of(&self, point: usize) -> f64 {
        match self {
            Self::Uniform(horizon) => *horizon,
            Self::PerLattice { horizons, of_point } => horizons[usize::from(of_point[point])],
            Self::Field(values) => values[point],
        }
    }

    /// The lattice of a point; the first where there are not several.
    pub fn lattice_of(&self, point: usize) -> usize {
        match self {
            Self::PerLattice { of_point, .. } => usize::from(of_point[point]),
            Self::Uniform(_) | Self::Field(_) => 0,
        }
    }

    /// That of all points, if they have one.
    pub fn uniform(&self) -> Option<f64> {
        match self {
            Self::Uniform(horizon) => Some(*horizon),
            Self::PerLattice { .. } | Self::Field(_) => None,
        }
    }

    /// The different ones, in no order.
    pub fn values(&self) -> &[f64] {
        match self {
            Self::Uniform(horizon) => std::slice::from_ref(horizon),
            Self::PerLattice { horizons, .. } => horizons,
            Self::Field(values) => values,
        }
    }

    /// The largest.
    pub fn largest(&self) -> f64 {
        self.values().iter().copied().fold(0.0, f64::max)
    }

    /// Keeps those of some points, in their order.
    pub fn retain(&mut self, mut keep: impl FnMut() -> bool) {
        match self {
            Self::Uniform(_) => {}
            Self::PerLattice { of_point, .. } => of_point.retain(|_| keep()),
            Self::Field(values) => values.retain(|_| keep()),
        }
    }

    /// Of `points` points, and of others behind them.
    #[must_use]
    pub fn followed_by(&self, points: usize, others: &[f64]) -> Self {
        let own = (0..points).map(|i| self.of(i));
        Self::of_field(own.chain(others.iter().copied()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_have_the_horizon_of_all_of_their_lattice_or_their_own() {
        assert_eq!(Horizon::of_field(vec![0.3; 4]), Horizon::Uniform(0.3));
        let field = Horizon::of_field(vec![0.3, 0.4, 0.5]);
        assert_eq!((field.of(2), field.uniform()), (0.5, None));
        let mut lattices = Horizon::PerLattice {
            horizons: vec![0.3, 0.3, 0.2],
            of_point: vec![0, 0, 1, 2],
        };
        assert_eq!((lattices.of(3), lattices.lattice_of(2)), (0.2, 1));
        assert_eq!(lattices.largest(), 0.3);
        let mut flags = [true, false, false, true].into_iter();
        lattices.retain(|| flags.next() == Some(true));
        assert_eq!((lattices.of(1), lattices.lattice_of(1)), (0.2, 2));
        let grouped = Horizon::Field(vec![0.5, 0.3, 0.5]).grouped();
        assert_eq!((grouped.values(), grouped.of(2)), (&[0.3, 0.5][..], 0.5));
        assert_eq!(BondHorizon::Larger.of([1, 2], &grouped), 0.5);
        assert_eq!(BondHorizon::OfCentre.of([1, 2], &grouped), 0.3);
        let more = Horizon::Uniform(0.1).followed_by(2, &[0.2]);
        assert_eq!(more, Horizon::Field(vec![0.1, 0.1, 0.2]));
        assert_eq!(
            Horizon::Uniform(0.1).followed_by(2, &[]).uniform(),
            Some(0.1)
        );
    }
}
