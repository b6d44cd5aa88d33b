//! Files as programs out there write them: run with `GIGALOD_DATA` set to the folder that has `scans` and `nasty`.

use crate::sources::{Model, read_with};
use gigalod_import::ByteSource;
use std::path::{Path, PathBuf};
use std::{fs, io};

type Outcome = Result<(usize, usize), &'static str>;

/// What each file of `nasty` but PLY gives: vertices and triangles, or the error. The counts are those of the lines of the
/// files; a polygon of n corners makes n − 2 triangles.
const NASTY: &[(&str, Outcome)] = &[
    ("assimp_BoxBadNormals-glTF-Binary_BoxBadNormals.glb", Ok((24, 12))),
    (
        "assimp_BoxWithInfinites-glTF-Binary_BoxWithInfinites.glb",
        Err("expected a finite position, found (-inf, -0.5, 0.5) (byte 0, position 0)"),
    ),
    (
        "assimp_IndexOutOfRange_AllIndicesOutOfRange.gltf",
        Err("expected an index below 24 as element 0, found 65535 (byte 0, accessor 0)"),
    ),
    (
        "assimp_IndexOutOfRange_IndexOutOfRange.gltf",
        Err("expected an index below 24 as element 0, found 255 (byte 0, accessor 0)"),
    ),
    (
        "assimp_MissingBin_BoxTextured.gltf",
        Err("expected the file `BoxTextured0.bin` beside the model, found No such file or directory (os error 2) \
             (byte 0, buffer 0)"),
    ),
    (
        "assimp_RecursiveNodes_RecursiveNodes.gltf",
        Err("expected each node at one place of a tree, found it at two (byte 0, node 0)"),
    ),
    ("assimp_box_UTF16BE.obj", Ok((8, 12))),
    // Polygons of up to 936 corners that go round and round the sides of a box.
    ("assimp_box_longline.obj", Ok((8, 944))),
    ("assimp_concave_polygon.obj", Ok((64, 64))),
    ("assimp_empty.obj", Err("expected a model, found an empty file")),
    ("assimp_issue_3269_texcoord_crash.gltf", Ok((20, 10))),
    ("assimp_malformed.obj", Err("expected a vertex number from 1 to 8, or from -8 to -1, found `12` (line 23)")),
    ("assimp_malformed2.obj", Err("expected the corners of a face after `f`, found none (line 23)")),
    ("assimp_number_formats.obj", Err("expected three numbers after `v`, found `3.1+e2` (line 11)")),
    ("assimp_only_a_part_of_vertexcolors.obj", Ok((5, 3))),
    ("assimp_point_cloud.obj", Ok((3, 0))),
    (
        "assimp_wrongTypes_badArray.gltf",
        Err("expected JSON of glTF, found invalid type: map, expected a sequence at line 44 column 26 (line 44)"),
    ),
    ("cgal_tetra_intersected_by_triangle.off", Ok((7, 5))),
    ("meshopt_fuzz.glb", Ok((24, 12))),
    // Faces of one and two corners.
    ("tinyobj_invalid-face-definition.obj", Ok((8, 0))),
    (
        "tinyobj_invalid-relative-texture-index.obj",
        Err("expected a texture coordinate number from 1 to 1, or from -1 to -1, found `1/-2` (line 2)"),
    ),
    (
        "tinyobj_invalid-relative-vertex-index.obj",
        Err("expected no vertex, of which there are none, found `-4` (line 1)"),
    ),
    (
        "tinyobj_issue-140-zero-face-idx.obj",
        Err("expected a vertex number from 1 to 4, or from -4 to -1, found `0/0/0` (line 16)"),
    ),
    ("tinyobj_issue-161-inconsistent-f.obj", Ok((8, 12))),
    ("tinyobj_issue-295-trianguation-failure.obj", Ok((16, 28))),
    ("tinyobj_missing_material_file.obj", Ok((76, 36))),
    ("tinyobj_test-nan.obj", Err("expected a finite position, found (NaN, NaN, NaN) (line 12)")),
    ("trimesh_empty_nodes.glb", Ok((0, 0))),
    ("trimesh_face_in_group_name.obj", Ok((1, 0))),
    ("trimesh_nancolor.obj", Ok((8, 12))),
    ("trimesh_negative_indices.obj", Ok((8, 12))),
    ("trimesh_notenoughindices.obj", Ok((3, 1))),
    ("trimesh_singlevn.obj", Ok((4, 2))),
    ("validator_chunk_too_big.glb", Err("the file ends before a chunk `JSON` (byte 13)")),
    ("validator_empty_file.glb", Err("expected a model, found an empty file")),
    (
        "validator_invalid_elements_float.gltf",
        Err("expected the file `invalid_elements_float.bin` beside the model, found No such file or directory \
             (os error 2) (byte 0, buffer 0)"),
    ),
    (
        "validator_invalid_json_chunk.glb",
        Err("expected JSON of glTF, found key must be a string at line 1 column 2 (byte 20)"),
    ),
    (
        "validator_invalid_magic.glb",
        Err("expected a model in a known format (PLY, glTF, LAS, E57, PCD, OFF, STL, OBJ, XYZ; plain or in gzip), \
             found a file that starts with `\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00`"),
    ),
    ("validator_invalid_uri_data.glb", Err("expected data in base64, found no comma after `data:` (byte 0, buffer 0)")),
    ("validator_length_mismatch.glb", Err("the file ends before its 49 bytes of GLB are complete (byte 48)")),
    // A chunk of another kind stands between the two that matter.
    ("validator_misplaced_bin_chunk.glb", Ok((0, 0))),
    ("validator_only_header.glb", Err("the file ends before a chunk `JSON` (byte 12)")),
    (
        "validator_out_of_range_elements_uint32.gltf",
        Err("expected the file `out_of_range_elements_uint32.bin` beside the model, found No such file or directory \
             (os error 2) (byte 0, buffer 0)"),
    ),
    ("validator_truncated_chunk_data.glb", Err("the file ends before its 48 bytes of GLB are complete (byte 47)")),
    ("validator_zero_length.glb", Err("the file ends before a chunk `JSON` (byte 0)")),
];

/// The test data, or none with a note.
fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("GIGALOD_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: GIGALOD_DATA not set");
    }
    folder
}

fn load(path: &Path) -> Result<Model, String> {
    let file = fs::File::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let folder = path.parent().expect("it is in a folder").to_owned();
    let side =
        move |name: &str| -> io::Result<Box<dyn ByteSource>> { Ok(Box::new(fs::File::open(folder.join(name))?)) };
    read_with(Box::new(file), Box::new(side)).map_err(|error| error.to_string())
}

#[test]
fn nasty_files_give_what_the_table_says() {
    let Some(data) = data() else { return };
    let mut results: Vec<_> = fs::read_dir(data.join("nasty"))
        .expect("the test data has a folder `nasty`")
        .map(|entry| entry.expect("it can be listed").path())
        .filter(|path| !matches!(path.extension().and_then(|it| it.to_str()), Some("ply" | "bin")))
        .map(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            (name, load(&path).map(|model| (model.positions.len(), model.triangles.len())))
        })
        .collect();
    results.sort();
    let expected: Vec<_> =
        NASTY.iter().map(|&(name, result)| (name.to_owned(), result.map_err(str::to_owned))).collect();
    for (found, expected) in results.iter().zip(&expected) {
        assert_eq!(found, expected);
    }
    assert_eq!(results, expected);
}

#[test]
fn objects_have_the_vertices_and_triangles_that_their_lines_say() {
    let Some(data) = data() else { return };
    // Lines `v` and `vt`; corners less two of lines `f`; different names after `usemtl`.
    for (name, vertices, tex_coords, triangles, materials) in [
        ("city/railway_lod3_obj/railway_lod3.obj", 78_175, 52_555, 121_914, 56),
        ("trees/eztree/ash_large.obj", 28_098, 28_098, 21_512, 2),
        ("trees/eztree/pine_medium.obj", 26_111, 26_111, 19_872, 2),
        ("trees/gazebo_oak_tree/oak_tree.obj", 812, 2_844, 948, 2),
    ] {
        let model = load(&data.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        let counts = (model.positions.len(), model.tex_coords.len(), model.triangles.len(), model.material_names.len());
        assert_eq!(counts, (vertices, tex_coords, triangles, materials), "{name}");
    }
}

#[test]
fn scenes_have_the_vertices_and_triangles_that_their_accessors_say() {
    let Some(data) = data() else { return };
    // Sums over the nodes of the counts in the JSON.
    for (name, vertices, triangles) in
        [("city/VirtualCity.glb", 19_483, 8_383), ("trees/DiffuseTransmissionPlant.glb", 44_794, 69_806)]
    {
        let model = load(&data.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((model.positions.len(), model.triangles.len()), (vertices, triangles), "{name}");
    }
}

#[test]
fn clouds_have_the_points_and_bounds_that_their_headers_say() {
    let Some(data) = data() else { return };
    for (name, points, has_colors) in [
        ("autzen_crop.laz", 1_357_056, true),
        ("autzen_trim.las", 110_000, true),
        ("1.2-with-color.las", 1_065, true),
        ("lion_takanawa.copc.laz", 341_989, true),
    ] {
        let path = data.join("points").join(name);
        let header = fs::read(&path).expect("it is there");
        let number = |at: usize| f64::from_le_bytes(*header[at..].first_chunk().expect("a header has 227 bytes"));
        let model = load(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((model.positions.len(), !model.colors.is_empty()), (points, has_colors), "{name}");
        for axis in 0..3 {
            let values = || model.positions.iter().map(|position| position[axis]);
            let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
            let (expected_high, expected_low) = (number(179 + 16 * axis), number(187 + 16 * axis));
            let scale = number(131 + 8 * axis);
            assert!(
                (low - expected_low).abs() <= scale && (high - expected_high).abs() <= scale,
                "{name}: {low}, {high}"
            );
        }
        // A picture has more than a few colours.
        let mut colors = model.colors.clone();
        colors.sort_unstable();
        colors.dedup();
        assert!(colors.len() > 300 && colors.last().is_some_and(|color| color[0] > 128), "{name}: {}", colors.len());
    }
}
