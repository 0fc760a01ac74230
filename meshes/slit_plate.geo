// Plate (-1/2, 1/2)^2 with a slit (-1/10, 1/10) x (-1/120, 1/120).
// Around the slit lies a block of square cells of size h = 1/120, aligned with it, that a peridynamic lattice fits;
// outside the block the cells grow to 1/20 at the edges.
// gmsh -2 -format msh41 slit_plate.geo -o slit_plate.msh
h = 1/120;
n = 34;         // half-width of the block, in cells: 34 h = 0.283 >= 1/10 + 3*0.05
m = 23;         // half-height of the block: 23 h = 0.192 >= 1/120 + 3*0.05
s = 12;         // half-length of the slit

// Columns x_0..x_3 and rows y_0..y_3 of points.
x[] = {-n*h, -s*h, s*h, n*h};
y[] = {-m*h, -h, h, m*h};
For j In {0:3}
  For i In {0:3}
    Point(1 + i + 4*j) = {x[i], y[j], 0, h};
  EndFor
EndFor
nx[] = {n - s, 2*s, n - s};
ny[] = {m - 1, 2, m - 1};
For j In {0:3}
  For i In {0:2}
    Line(101 + i + 3*j) = {1 + i + 4*j, 2 + i + 4*j};
    Transfinite Curve {101 + i + 3*j} = nx[i] + 1;
  EndFor
EndFor
For j In {0:2}
  For i In {0:3}
    Line(201 + i + 4*j) = {1 + i + 4*j, 5 + i + 4*j};
    Transfinite Curve {201 + i + 4*j} = ny[j] + 1;
  EndFor
EndFor
block[] = {};
For j In {0:2}
  For i In {0:2}
    If (i != 1 || j != 1)
      c = 301 + i + 3*j;
      Curve Loop(c) = {101 + i + 3*j, 202 + i + 4*j, -(104 + i + 3*j), -(201 + i + 4*j)};
      Plane Surface(c) = {c};
      Transfinite Surface {c};
      Recombine Surface {c};
      block[] += {c};
    EndIf
  EndFor
EndFor

Point(51) = {-0.5, -0.5, 0, 1/20};
Point(52) = { 0.5, -0.5, 0, 1/20};
Point(53) = { 0.5,  0.5, 0, 1/20};
Point(54) = {-0.5,  0.5, 0, 1/20};
Line(401) = {51, 52};
Line(402) = {52, 53};
Line(403) = {53, 54};
Line(404) = {54, 51};
Curve Loop(401) = {401, 402, 403, 404};
Curve Loop(402) = {101, 102, 103, 204, 208, 212, -112, -111, -110, -209, -205, -201};
Plane Surface(401) = {401, 402};
Recombine Surface {401};

Mesh.Algorithm = 8;                // frontal Delaunay for quads
Mesh.RecombinationAlgorithm = 3;   // blossom, full quads
Mesh.MeshSizeExtendFromBoundary = 1;

Physical Surface("plate") = {block[], 401};
Physical Curve("bottom") = {401};
Physical Curve("right") = {402};
Physical Curve("top") = {403};
Physical Curve("left") = {404};
Physical Curve("slit") = {105, 206, 108, 207};
