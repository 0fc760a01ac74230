// Beam 64 mm high with places for supports 256 mm apart and for loads, with room for a crack from below. Units: mm.
// gmsh -2 -format msh41 bending.geo -o bending.msh
w = 64;
x[] = {-140, -128, 128, 140, 140, 64, 0, -64, -140};   // the second and third supports, 64, 0 and -64 loads
For k In {1:9}
  Point(k) = {x[k - 1], (k > 4) * w, 0};
EndFor
For k In {1:9}
  Line(k) = {k, k % 9 + 1};
EndFor
Curve Loop(1) = {1:9};
Plane Surface(1) = {1};
Physical Surface("beam") = {1};
Field[1] = Box;                // four spacings around the zone
Field[1].XMin = -18;
Field[1].XMax = 18;
Field[1].YMin = 0;
Field[1].YMax = w;
Field[1].VIn = 4;
Field[1].VOut = 8;
Field[1].Thickness = 60;
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
