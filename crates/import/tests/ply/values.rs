//! What values mean: normals, colours, polygons and strips.

use crate::sources::{Model, error, read};

/// A text file with three vertices of the given extra properties and values, and perhaps faces.
fn model(properties: &[&str], values: [&str; 3]) -> Model {
    let properties: String = properties.iter().map(|property| format!("property {property}\n")).collect();
    let [a, b, c] = values;
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 3\n{properties}property int x\nproperty int y\nproperty int z\n\
        end_header\n{a} 0 0 0\n{b} 0 0 0\n{c} 0 0 0\n"
    );
    read(text.as_bytes()).unwrap_or_else(|error| panic!("{error} in\n{text}"))
}

fn corners(element: &str, body: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex 5\nproperty int x\nproperty int y\nproperty int z\n\
        element {element} 1\nproperty list int int vertex_indices\nend_header\n{}{body}\n",
        "0 0 0\n".repeat(5)
    )
}

#[test]
fn normals_are_kept_as_they_are_and_zero_where_not_finite() {
    let model = model(&["float nz", "double ny", "float nx"], ["3 2 1", "nan 0 1", "0 1e300 0"]);
    assert_eq!(model.normals, [[1.0, 2.0, 3.0], [0.0; 3], [0.0; 3]]);
}

#[test]
fn two_thirds_of_a_normal_or_colour_are_none() {
    let model = model(&["float nz", "float ny", "uchar red", "uchar blue"], ["0 0 0 0"; 3]);
    assert!(model.normals.is_empty() && model.colors.is_empty());
}

#[test]
fn colours_of_any_type_become_8_bits() {
    let rgb = |names: [&str; 3], scalar: &str, values| {
        let properties = names.map(|name| format!("{scalar} {name}"));
        model(&properties.each_ref().map(String::as_str), values).colors
    };
    let long = ["red", "green", "blue"];
    let diffuse = ["diffuse_red", "diffuse_green", "diffuse_blue"];
    assert_eq!(
        rgb(long, "uchar", ["0 1 2", "253 254 255", "128 127 300"]),
        [[0, 1, 2], [253, 254, 255], [128, 127, 255]]
    );
    assert_eq!(rgb(diffuse, "char", ["0 1 2", "127 -1 -128", "3 4 5"]), [[0, 1, 2], [127, 0, 0], [3, 4, 5]]);
    assert_eq!(
        rgb(["r", "g", "b"], "ushort", ["65535 257 0", "128 129 32768", "0 0 0"]),
        [[255, 1, 0], [0, 1, 128], [0; 3]]
    );
    assert_eq!(
        rgb(long, "float", ["0 0.5 1", "-1 2 nan", "inf -inf 0.998"]),
        [[0, 128, 255], [0, 255, 0], [255, 0, 254]]
    );
}

#[test]
fn the_first_complete_set_of_colour_names_wins() {
    let names = ["uchar r", "uchar g", "uchar b", "uchar green", "uchar blue", "uchar red"];
    assert_eq!(model(&names, ["1 2 3 5 6 4"; 3]).colors, [[4, 5, 6]; 3]);
}

#[test]
fn polygons_become_fans_and_smaller_things_nothing() {
    let triangles = |body| read(corners("face", body).as_bytes()).expect("it is a good file").triangles;
    assert_eq!(triangles("5 4 3 2 1 0"), [[4, 3, 2], [4, 2, 1], [4, 1, 0]]);
    assert_eq!(triangles("3 1 1 2"), [[1, 1, 2]], "degenerate triangles are for the builder to judge");
    for body in ["0", "1 0", "2 0 1"] {
        assert!(triangles(body).is_empty(), "{body}");
    }
}

#[test]
fn strips_alternate_restart_and_drop_degenerate_triangles() {
    let text = corners("tristrips", "11 0 1 2 3 -1 2 3 4 4 0 1");
    let model = read(text.as_bytes()).expect("it is a good file");
    assert_eq!(model.triangles, [[0, 1, 2], [2, 1, 3], [2, 3, 4], [0, 4, 1]]);
    assert_eq!(
        error(corners("tristrips", "3 0 1 -2").as_bytes()),
        "expected a vertex number below 5, found -2 (line 15, tristrips 0)"
    );
}

#[test]
fn lists_on_vertices_are_skipped() {
    let model = model(
        &["list uchar int faces", "uchar red", "list int float w", "uchar green", "uchar blue"],
        ["0 1 0 2 3", "2 7 8 1 1 9.5 2 3", "1 7 1 0 2 3"],
    );
    assert_eq!(model.colors, [[1, 2, 3]; 3]);
}
