// A quarter of a square plate of half width 4 with a hole of radius 1, cells of second order; made by Gmsh 4.8.4:
// gmsh -2 kirsch.geo -format msh41 -o kirsch_tri6.msh, and with -setnumber quads 1 kirsch_quad8.msh
DefineConstant[ quads = 0 ];
Mesh.ElementOrder = 2; Mesh.SecondOrderIncomplete = 1; Mesh.Algorithm = 6; Mesh.RecombinationAlgorithm = 0;
Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {4, 0, 0}; Point(4) = {4, 4, 0}; Point(5) = {0, 4, 0}; Point(6) = {0, 1, 0};
Point(7) = {Cos(Pi/4), Sin(Pi/4), 0};
Line(1) = {2, 3}; Line(2) = {3, 4}; Line(3) = {4, 5}; Line(4) = {5, 6};
Circle(5) = {6, 1, 7}; Circle(6) = {7, 1, 2};
If (quads)
  Line(7) = {7, 4};
  Curve Loop(1) = {1, 2, -7, 6}; Curve Loop(2) = {7, 3, 4, 5};
  Plane Surface(1) = {1}; Plane Surface(2) = {2};
  Transfinite Curve {2, 3, 5, 6} = 7;
  Transfinite Curve {1, -4, 7} = 11 Using Progression 1.25;
  Transfinite Surface {1} = {2, 3, 4, 7}; Transfinite Surface {2} = {7, 4, 5, 6};
  Recombine Surface {1, 2};
  Physical Surface("plate") = {1, 2};
Else
  Curve Loop(1) = {1, 2, 3, 4, 5, 6};
  Plane Surface(1) = {1};
  MeshSize {2, 6, 7} = 0.08; MeshSize {3, 4, 5} = 0.8;
  Physical Surface("plate") = {1};
EndIf
Physical Curve("bottom") = {1}; Physical Curve("right") = {2}; Physical Curve("top") = {3}; Physical Curve("left") = {4}; Physical Curve("hole") = {5, 6};
