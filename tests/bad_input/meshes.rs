//! Wrong meshes.

use crate::{edit, mesh, refused, scene_of_mesh};

fn wrong_mesh(edits: &[(&str, &str)], parts: &[&str]) {
    refused(&scene_of_mesh(), &edit(mesh(), edits), &[], parts);
}

fn cut_mesh(length: usize, parts: &[&str]) {
    refused(&scene_of_mesh(), &mesh()[..length], &[], parts);
}

#[test]
fn mesh_of_wrong_dimension() {
    let scene = edit(scene_of_mesh(), &[(r#""plane-stress""#, r#""solid""#)]);
    refused(
        &scene,
        &mesh(),
        &[],
        &[
            "a mesh of dimension 3 was asked for",
            "use the dimension found",
        ],
    );
}

#[test]
fn degenerate_cell() {
    wrong_mesh(
        &[("17 3 2 3 3 1 2 11 10", "17 3 2 3 3 1 2 2 10")],
        &[
            "cell 0 (Quad4)",
            "(0.062500, 0.031250)",
            "by the numbers of the file: element 17",
        ],
    );
}

#[test]
fn flat_cell() {
    wrong_mesh(
        &[("\n11 0.125 0.125 0\n", "\n11 0.0625 0.0625 0\n")],
        &["cell 0 (Quad4)"],
    );
}

#[test]
fn duplicate_node() {
    wrong_mesh(
        &[("\n11 0.125 0.125 0\n", "\n10 0.125 0.125 0\n")],
        &[
            "m.msh: line 22",
            "node 10 was already defined at line 21",
            "renumber the nodes",
        ],
    );
}

#[test]
fn coincident_nodes() {
    wrong_mesh(
        &[
            ("$Nodes\n81", "$Nodes\n82"),
            ("$EndNodes", "82 0.5 0.5 0\n$EndNodes"),
            ("50 51 60 59", "82 51 60 59"),
        ],
        &["nodes 40 and 81 both lie at (0.500000, 0.500000)"],
    );
}

#[test]
fn truncated() {
    cut_mesh(
        900,
        &[
            "m.msh: line 67",
            "the file ends within $Nodes",
            "it is truncated, write it again",
        ],
    );
}

#[test]
fn truncated_elements() {
    cut_mesh(
        2891,
        &[
            "m.msh: line 171",
            "the file ends within $Elements",
            "write it again",
        ],
    );
}

#[test]
fn nan() {
    wrong_mesh(
        &[("\n11 0.125 0.125 0\n", "\n11 nan 0.125 0\n")],
        &[
            "m.msh: line 22",
            "coordinate x of node 11 is NaN",
            "finite number",
        ],
    );
}

#[test]
fn missing_node() {
    wrong_mesh(
        &[("17 3 2 3 3 1 2 11 10", "17 3 2 3 3 1 2 111 10")],
        &[
            "m.msh: line 112",
            "element 17 refers to node 111",
            "save the mesh with all its nodes",
        ],
    );
}

#[test]
fn out_of_plane() {
    wrong_mesh(
        &[("\n11 0.125 0.125 0\n", "\n11 0.125 0.125 0.1\n")],
        &["m.msh: line 22", "node 11 has z = 0.1", "flatten the mesh"],
    );
}

#[test]
fn no_such_group() {
    let scene = edit(scene_of_mesh(), &[(r#"on = "left""#, r#"on = "bottom""#)]);
    refused(
        &scene,
        &mesh(),
        &[],
        &["the mesh has no set `bottom`", "it has the set `all`"],
    );
}

#[test]
fn empty_mesh() {
    cut_mesh(104, &["m.msh: line 10", "the file ends"]);
}

#[test]
fn two_parts() {
    wrong_mesh(
        &[
            ("$Nodes\n81", "$Nodes\n85"),
            (
                "$EndNodes",
                "82 3 3 0\n83 4 3 0\n84 4 4 0\n85 3 4 0\n$EndNodes",
            ),
            ("$Elements\n80", "$Elements\n81"),
            ("$EndElements", "81 3 2 3 3 82 83 84 85\n$EndElements"),
        ],
        &[
            "the system is singular",
            "4 sites are free to move",
            "site 72 [3.0",
            "prescribe displacements",
        ],
    );
}

#[test]
fn mesh_traction_on_cells() {
    let scene = edit(scene_of_mesh(), &[(r#"on = "right""#, r#"on = "body""#)]);
    refused(
        &scene,
        &mesh(),
        &[],
        &[
            "the set `body` of the mesh is no set of",
            "it has the set of edges `left`, `right`",
        ],
    );
}
