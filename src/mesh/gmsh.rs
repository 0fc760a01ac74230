//! Reading Gmsh MSH files.
