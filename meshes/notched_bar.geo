// Notched bar: a cylinder of 22 mm diameter with a semicircular notch of 5 mm radius around its middle.
// gmsh -3 -format msh41 notched_bar.geo -o notched_bar.msh
SetFactory("OpenCASCADE");
Cylinder(1) = {0, 0, -15, 0, 0, 30, 11};
Torus(2) = {0, 0, 0, 11, 5};
BooleanDifference(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
MeshSize {:} = 2.2;
Mesh.MeshSizeFromCurvature = 14;
Mesh.MeshSizeMax = 2.2;
Physical Volume("bar") = {3};
