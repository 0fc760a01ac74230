//! Which bonds leave the mesh.
