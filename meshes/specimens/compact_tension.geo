// Compact tension specimen of ASTM E399, W = 120 mm from the line of the load, x = 0. Units: mm.
// gmsh -2 -format msh41 compact_tension.geo -o compact_tension.msh
w = 120;
Point(1) = {-0.25*w, -0.6*w, 0};
Point(2) = {w, -0.6*w, 0};
Point(3) = {w, 0.6*w, 0};
Point(4) = {-0.25*w, 0.6*w, 0};
For k In {1:4}
  Line(k) = {k, k % 4 + 1};
EndFor
Curve Loop(1) = {1:4};
// holes whose outermost points the pins hold
r = 0.125*w;
For s In {-1:1:2}
  c = 10 + 5*(s + 1);
  y = s*0.275*w;
  Point(c) = {0, y, 0};
  Point(c + 1) = {0, y + s*r, 0};
  Point(c + 2) = {-r, y, 0};
  Point(c + 3) = {0, y - s*r, 0};
  Point(c + 4) = {r, y, 0};
  For k In {1:4}
    Circle(c + k) = {c + k, c, c + k % 4 + 1};
  EndFor
  Curve Loop(c) = {c + 1:c + 4};
EndFor
Plane Surface(1) = {1, 10, 20};
Physical Surface("specimen") = {1};
Field[1] = Box;                // four spacings around the zone
Field[1].XMin = -0.25*w;
Field[1].XMax = w;
Field[1].YMin = -16;
Field[1].YMax = 16;
Field[1].VIn = 4;
Field[1].VOut = 12;
Field[1].Thickness = 40;
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
