//! What becomes of each of the odd files that other projects keep for tests (the folder `nasty` of `GIGALOD_DATA`): tested
//! through the library, and through the program.
#![allow(dead_code, reason = "each test uses its own part")]

/// Vertices and triangles, or the error.
pub(crate) type Outcome = Result<(usize, usize), &'static str>;

/// What each PLY file gives: vertices and triangles, or the error.
pub(crate) const PLY: &[(&str, Outcome)] = &[
    (
        "assimp_crash-30d6d0f7c529b3b66b4131700b7a4580cd7082df.ply",
        Err(
            "expected `property TYPE NAME` or `property list TYPE TYPE NAME`, with types among char uchar short ushort \
            int uint float double, found `property \\x00\\x00\\x00\\t\\x07\\x00\\x00\\x00\\x03\\x00\\x00\\x00\\x03\\x03\
            \\x00\\x00\\x00\\x07\\x00\\x00\\x00\\x04\\x00\\x00\\x00\\x03\\x03\\x00\\x00\\x00\\x04\\x00\\x00\\x00\\x00\\x00\\x00\\x00` \
            (line 7)",
        ),
    ),
    ("assimp_cube_binary_header_with_RN_newline.ply", Ok((8, 12))),
    ("assimp_cube_binary_starts_with_nl.ply", Ok((8, 12))),
    ("assimp_cube_uv.ply", Ok((24, 12))),
    ("assimp_empty.ply", Err("expected a model, found an empty file")),
    ("assimp_float-color.ply", Ok((3, 1))),
    // Its vertices are declared with a list, which no line has.
    (
        "assimp_issue623.ply",
        Err("expected the length of the list `vertex_indices`, found 7.941797 (line 15, vertex 0)"),
    ),
    ("assimp_points.ply", Ok((4, 0))),
    ("happly_platonic_shelf_ascii.ply", Ok((50, 80))),
    ("happly_platonic_shelf_big_endian.ply", Ok((50, 80))),
    ("trimesh_ply_empty_header.ply", Err("expected an element `vertex`, found none (line 3)")),
    ("trimesh_ply_points_bin.ply", Ok((8, 0))),
    ("trimesh_points_ascii_with_lists.ply", Ok((5, 0))),
    ("trimesh_points_emptyface.ply", Ok((1024, 0))),
];

/// What each file of `nasty` but PLY gives: vertices and triangles, or the error. The counts are those of the lines of the
/// files; a polygon of n corners makes n − 2 triangles.
pub(crate) const OTHERS: &[(&str, Outcome)] = &[
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
        Err(
            "expected a model in a known format (PLY, glTF, LAS, E57, PCD, OFF, STL, OBJ, XYZ or PTS; plain or in gzip), \
             found a file that starts with `\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00`",
        ),
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
