// Bar 6 x 1 x 1 of hexahedra of size 1/4, its axis along x.
// gmsh -3 -format msh41 -bin bar_hexes.geo -o bar_hexes.msh
Point(1) = {0, 0, 0, 1};
line[] = Extrude {6, 0, 0} { Point{1}; Layers{24}; Recombine; };
face[] = Extrude {0, 1, 0} { Curve{line[1]}; Layers{4}; Recombine; };
body[] = Extrude {0, 0, 1} { Surface{face[1]}; Layers{4}; Recombine; };

Physical Volume("bar") = {body[1]};
Physical Surface("start") = Surface In BoundingBox {-0.1, -0.1, -0.1, 0.1, 1.1, 1.1};
Physical Surface("end") = Surface In BoundingBox {5.9, -0.1, -0.1, 6.1, 1.1, 1.1};
Physical Point("corner") = {1};
