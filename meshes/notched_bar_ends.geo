// Notched bar as in notched_bar.geo, cut at |z| = 7.5 mm: finite elements in the ends, points between them. `size` is the length of edges, `seam` that where both meet.
// gmsh -3 -format msh41 notched_bar_ends.geo -o notched_bar_ends.msh
// gmsh -3 -format msh41 -setnumber seam 1.5 notched_bar_ends.geo -o notched_bar_ends_fine.msh
SetFactory("OpenCASCADE");
DefineConstant[ size = 2.2, seam = size ];
Cylinder(1) = {0, 0, -7.5, 0, 0, 15, 11};
Torus(2) = {0, 0, 0, 11, 5};
BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Cylinder(4) = {0, 0, 7.5, 0, 0, 7.5, 11};
Cylinder(5) = {0, 0, -15, 0, 0, 7.5, 11};
BooleanFragments{ Volume{3}; Delete; }{ Volume{4,5}; Delete; }
MeshSize {:} = size;
Mesh.MeshSizeFromCurvature = 14;
Mesh.MeshSizeMax = size;
cut() = Point In BoundingBox {-12, -12, -7.6, 12, 12, 7.6};
MeshSize {cut()} = seam;
Physical Volume("notch") = {3};
Physical Volume("ends") = {4,5};
