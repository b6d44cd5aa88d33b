//! Lines and words of text bodies.

use crate::sources::{error, read};

fn points(count: usize, body: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
        end_header\n{body}"
    )
}

#[test]
fn more_values_than_declared_are_ignored_to_the_end_of_the_line() {
    let model = read(points(2, "1 2 3 255 0 0\n4 5 6 what else\n").as_bytes()).expect("it is a good file");
    assert_eq!(model.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
}

#[test]
fn an_item_may_take_several_lines_when_it_ends_where_a_line_does() {
    for body in ["1\n2\n3\n4\n5\n6", "1 2\n3 \n\n4\n\n5 6\n", "1 2 3\n4\r\n5 6 \r\n"] {
        let model = read(points(2, body).as_bytes()).expect("it is a good file");
        assert_eq!(model.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "{body:?}");
    }
}

#[test]
fn a_missing_value_is_found_in_the_next_line() {
    let expected = "expected a line end after the values that line 8 lacks, found `5` (line 9, vertex 0)";
    assert_eq!(error(points(3, "1 2\n4 5 6\n7 8 9\n").as_bytes()), expected);
    let expected = "the file ends before vertex 2 of 3 is complete (line 11)";
    assert_eq!(error(points(3, "1 2 3\n4 5 6\n7 8\n").as_bytes()), expected);
}

#[test]
fn what_follows_the_last_element_is_ignored() {
    let model = read(points(1, "1 2 3\nand more\n").as_bytes()).expect("it is a good file");
    assert_eq!(model.positions, [[1.0, 2.0, 3.0]]);
}

#[test]
fn numbers_may_be_written_in_many_ways() {
    let model = read(points(2, "+1 -2.50e+1 .5\n3. 1E2 -0\n").as_bytes()).expect("it is a good file");
    assert_eq!(model.positions, [[1.0, -25.0, 0.5], [3.0, 100.0, 0.0]]);
}

#[test]
fn whole_numbers_may_have_a_point() {
    let text = "ply\nformat ascii 1.0\nelement face 1\nproperty list float double vertex_index\n\
        element vertex 3\nproperty int x\nproperty int y\nproperty int z\nend_header\n3.0 2.0 1 0e5\n0 0 0.25\n1 1 1\n2 2 2\n";
    let model = read(text.as_bytes()).expect("it is a good file");
    assert_eq!(model.triangles, [[2, 1, 0]]);
    assert_eq!(model.positions[0], [0.0, 0.0, 0.25]);
}

#[test]
fn skipped_properties_need_not_be_numbers() {
    let text = points(1, "1 red 2 3\n").replace("property float y", "property int name\nproperty float y");
    assert_eq!(read(text.as_bytes()).expect("it is a good file").positions, [[1.0, 2.0, 3.0]]);
}

#[test]
fn an_endless_word_is_refused_without_being_stored() {
    let expected =
        format!("expected a number of at most 4096 characters, found `{}…` (line 8, vertex 0)", "1".repeat(48));
    assert_eq!(error(points(1, &"1".repeat(1_000_000)).as_bytes()), expected);
}
