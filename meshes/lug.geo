// Lug: a plate with a rounded end and a hole at its centre, clamped at the flat end.
// gmsh -2 -format msh41 lug.geo -o lug.msh
r = 0.25;     // hole
w = 0.6;      // half-width, and radius of the rounded end
l = 1.8;      // from the hole's centre to the clamped end
fine = 0.02;
coarse = 0.08;

Point(1) = {0, 0, 0, fine};          // centre of both arcs, used by no cell
Point(2) = {r, 0, 0, fine};
Point(3) = {0, r, 0, fine};
Point(4) = {-r, 0, 0, fine};
Point(5) = {0, -r, 0, fine};
Circle(1) = {2, 1, 3};
Circle(2) = {3, 1, 4};
Circle(3) = {4, 1, 5};
Circle(4) = {5, 1, 2};
Point(6) = {-l, -w, 0, coarse};
Point(7) = {0, -w, 0, coarse/2};
Point(8) = {w, 0, 0, coarse/2};
Point(9) = {0, w, 0, coarse/2};
Point(10) = {-l, w, 0, coarse};
Line(5) = {6, 7};
Circle(6) = {7, 1, 8};
Circle(7) = {8, 1, 9};
Line(8) = {9, 10};
Line(9) = {10, 6};
Curve Loop(1) = {5, 6, 7, 8, 9};
Curve Loop(2) = {1, 2, 3, 4};
Plane Surface(1) = {1, 2};

Physical Surface("lug") = {1};
Physical Curve("fixed") = {9};
Physical Curve("hole") = {1, 2, 3, 4};
Physical Curve("loaded") = {1, 4};    // the half of the hole that a pin pulls at
Physical Curve("outside") = {5, 6, 7, 8};
