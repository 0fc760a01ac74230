//! Reading VTK and VTU files.
