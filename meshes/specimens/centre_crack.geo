// Plate with room for a centre crack of 60 mm, 5/2 times as high as wide. Units: mm.
// gmsh -2 -format msh41 centre_crack.geo -o centre_crack_25.msh
// gmsh -2 -format msh41 -setnumber width 600 centre_crack.geo -o centre_crack_10.msh
// gmsh -2 -format msh41 -setnumber width 120 centre_crack.geo -o centre_crack_50.msh
// gmsh -2 -format msh41 -setnumber horizon 1.5 centre_crack.geo -o centre_crack_half.msh
// gmsh -2 -format msh41 -setnumber horizon 0.75 centre_crack.geo -o centre_crack_quarter.msh
DefineConstant[ width = 240, horizon = 3 ];
w = width/2;
h = 2.5*w;
Point(1) = {-w, -h, 0};
Point(2) = {w, -h, 0};
Point(3) = {w, h, 0};
Point(4) = {-w, h, 0};
For k In {1:4}
  Line(k) = {k, k % 4 + 1};
EndFor
Curve Loop(1) = {1:4};
Plane Surface(1) = {1};
Physical Surface("plate") = {1};
Physical Curve("bottom") = {1};
Physical Curve("top") = {3};
Field[1] = Box;                // four spacings around the zone
Field[1].XMin = -30 - 6*horizon;
Field[1].XMax = 30 + 6*horizon;
Field[1].YMin = -5*horizon;
Field[1].YMax = 5*horizon;
Field[1].VIn = 4/3*horizon;
Field[1].VOut = w/4;
Field[1].Thickness = w;
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
