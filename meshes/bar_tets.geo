// Bar 6 x 1 x 1 of tetrahedra of size about 1/3, its axis along x; written in the older format 2.2.
// gmsh -3 -format msh22 bar_tets.geo -o bar_tets.msh
Point(1) = {0, 0, 0, 1/3};
Point(2) = {0, 1, 0, 1/3};
Point(3) = {0, 1, 1, 1/3};
Point(4) = {0, 0, 1, 1/3};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
body[] = Extrude {6, 0, 0} { Surface{1}; };

Mesh.Optimize = 1;
Physical Volume("bar") = {body[1]};
Physical Surface("start") = {1};
Physical Surface("end") = {body[0]};
Physical Surface("sides") = {body[{2:5}]};
