// Double cantilever, arms 30 mm high, 240 mm long, that opens at its left end. Units: mm.
// gmsh -2 -format msh41 double_cantilever.geo -o double_cantilever.msh
h = 30;
l = 240;
Point(1) = {0, -h, 0};         // lower load
Point(2) = {l, -h, 0};
Point(3) = {l, 0, 0};          // held
Point(4) = {l, h, 0};
Point(5) = {0, h, 0};          // upper load
For k In {1:5}
  Line(k) = {k, k % 5 + 1};
EndFor
Curve Loop(1) = {1:5};
Plane Surface(1) = {1};
Physical Surface("specimen") = {1};
Field[1] = Box;                // four spacings around the zone
Field[1].XMin = 0;
Field[1].XMax = 170;
Field[1].YMin = -15;
Field[1].YMax = 15;
Field[1].VIn = 4;
Field[1].VOut = 10;
Field[1].Thickness = 40;
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
