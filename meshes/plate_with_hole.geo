// Plate with a hole of SAND2015-7998 section 6.2.5, 50 × 150 × 5 mm, cut at |y| = 40 mm: points between, finite elements in the ends. `size` is the length of edges.
// gmsh -3 -format msh41 plate_with_hole.geo -o plate_with_hole.msh
SetFactory("OpenCASCADE");
DefineConstant[ size = 2.5 ];
Rectangle(1) = {-25, -40, -2.5, 50, 80};
Disk(2) = {0, 0, -2.5, 10};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Rectangle(4) = {-25, 40, -2.5, 50, 35};
Rectangle(5) = {-25, -75, -2.5, 50, 35};
BooleanFragments{ Surface{3}; Delete; }{ Surface{4,5}; Delete; }
Transfinite Surface{4}; Transfinite Surface{5};
Recombine Surface{:};
MeshSize{:} = size;
Mesh.MeshSizeMax = size;
Mesh.Algorithm = 8;
Mesh.RecombinationAlgorithm = 2;
Extrude {0, 0, 5} { Surface{3,4,5}; Layers{2}; Recombine; }
Physical Volume("middle") = {1};
Physical Volume("ends") = {2,3};
