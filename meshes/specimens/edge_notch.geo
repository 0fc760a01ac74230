// Strip 160 mm wide and three times as long, with room for a crack from its left edge. Units: mm.
// gmsh -2 -format msh41 edge_notch.geo -o edge_notch.msh
w = 160;
h = 1.5*w;
Point(1) = {0, -h, 0};
Point(2) = {w/2, -h, 0};       // lower pin
Point(3) = {w, -h, 0};
Point(4) = {w, h, 0};
Point(5) = {w/2, h, 0};        // upper pin
Point(6) = {0, h, 0};
For k In {1:6}
  Line(k) = {k, k % 6 + 1};
EndFor
Curve Loop(1) = {1:6};
Plane Surface(1) = {1};
Physical Surface("strip") = {1};
Field[1] = Box;                // four spacings around the zone
Field[1].XMin = 0;
Field[1].XMax = 115;
Field[1].YMin = -18;
Field[1].YMax = 18;
Field[1].VIn = 4;
Field[1].VOut = 20;
Field[1].Thickness = 80;
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
