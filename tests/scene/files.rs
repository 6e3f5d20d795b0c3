//! How a scene can be distributed over files.

use std::fs;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ppm_vk::internals::scene::Scene;
use serde_json::json;

use crate::fixture::{Fixture, assert_error};

#[test]
fn external_embedded_and_binary_buffers_give_the_same_scene() {
    let mut room = Fixture::room();
    let external = room.scene();
    let binary = room.load_bytes("room.glb", &room.glb()).expect("the .glb loads");
    let embedded = room.load_embedded().expect("the data URI loads");
    for (scene, name) in [(&binary, "room"), (&embedded, "embedded")] {
        assert_eq!(scene.positions, external.positions);
        assert_eq!(scene.triangles, external.triangles);
        assert_eq!(scene.name, name, "the scene is named after its file");
    }
    assert_eq!(external.triangles.len(), 3);
    assert!(external.warnings.is_empty(), "{:?}", external.warnings);
}

#[test]
fn base64_may_lack_its_padding() {
    let mut room = Fixture::room();
    while room.binary.len().is_multiple_of(3) {
        room.binary.push(0);
    }
    room.load_embedded().expect("padded base64 loads");
    let uri = room.json["buffers"][0]["uri"].as_str().expect("a URI").to_owned();
    assert!(uri.ends_with('='), "the test needs padding to remove");
    room.set("/buffers/0/uri", json!(uri.trim_end_matches('=')));
    room.load().expect("base64 without padding loads");
}

#[test]
fn buffer_uris_are_percent_decoded_and_may_lead_into_folders() {
    let mut room = Fixture::room();
    fs::create_dir(room.path("my data")).expect("a folder");
    room.write("my data/50% ä.bin", &room.binary);
    room.set("/buffers/0/uri", json!("./my%20data/50% %C3%A4.bin"));
    room.scene();
}

#[test]
fn relative_uris_may_lead_up_and_have_a_query() {
    let mut room = Fixture::room();
    fs::create_dir(room.path("scene")).expect("a folder");
    room.write("my room.bin", &room.binary);
    for uri in [
        "../my room.bin",
        "%2e%2e/my%20room.bin",
        "../my%20room.bin?v=2",
        "../my room.bin#part",
    ] {
        room.set("/buffers/0/uri", json!(uri));
        room.load_bytes("scene/room.gltf", room.json.to_string().as_bytes())
            .expect(uri);
    }
    // Both are valid names.
    room.write("what?#.bin", &room.binary);
    room.set("/buffers/0/uri", json!("../what?#.bin"));
    room.load_bytes("scene/room.gltf", room.json.to_string().as_bytes())
        .expect("a file of that name");
}

#[test]
fn buffer_uris_that_lead_elsewhere_are_refused() {
    let uris = [
        ("http://example.org/room.bin", "\"http\""),
        ("file:///tmp/room.bin", "\"file\""),
        ("/tmp/room.bin", "isn't relative"),
        ("%2ftmp/room.bin", "isn't relative"),
        ("room%00.bin", "isn't a valid file name"),
        ("%ff.bin", "isn't a valid file name"),
    ];
    for (uri, part) in uris {
        let mut room = Fixture::room();
        room.set("/buffers/0/uri", json!(uri));
        room.assert_fails(&["buffer 0", part]);
    }
}

#[test]
fn bad_data_uris_are_named() {
    let uris = [
        ("data:application/octet-stream;base64", "no comma"),
        ("data:application/octet-stream,a%62c", "has 3 bytes"),
        ("data:;base64,@@@@", "isn't valid base64"),
        ("data:;base64,AAAA", "has 3 bytes"),
    ];
    for (uri, part) in uris {
        let mut room = Fixture::room();
        room.set("/buffers/0/uri", json!(uri));
        room.assert_fails(&["buffer 0", part]);
    }
}

#[test]
fn data_uris_may_be_in_capitals_percent_encoded_or_on_several_lines() {
    let plain = Fixture::room().scene();
    let room = Fixture::room();
    let base64 = STANDARD.encode(&room.binary);
    let lines = base64
        .as_bytes()
        .chunks(76)
        .map(String::from_utf8_lossy)
        .collect::<Vec<_>>();
    let encoded = base64.replace('+', "%2B").replace('/', "%2f").replace('=', "%3D");
    let percents: String = room.binary.iter().map(|byte| format!("%{byte:02x}")).collect();
    for uri in [
        format!("data:application/octet-stream;base64,{base64}"),
        format!("DATA:;charset=utf-8;BASE64,{base64}"),
        format!("data:;base64,{encoded}"),
        format!("data:;base64,{}", lines.join("\r\n")),
        format!("data:,{percents}"),
    ] {
        let mut room = Fixture::room();
        room.set("/buffers/0/uri", json!(uri));
        assert_eq!(room.scene().positions, plain.positions, "{uri}");
    }
}

#[test]
fn a_missing_or_short_buffer_is_named() {
    let mut room = Fixture::room();
    room.set("/buffers/0/name", json!("data"));
    room.set("/buffers/0/uri", json!("absent.bin"));
    room.assert_fails(&["buffer 0 \"data\"", "absent.bin", "can't be read"]);

    room.set("/buffers/0/uri", json!("."));
    room.assert_fails(&["buffer 0", "isn't a file"]);

    let mut room = Fixture::room();
    room.binary.truncate(10);
    room.assert_fails(&["buffer 0", "room.bin", "has 10 bytes"]);

    let mut room = Fixture::room();
    room.remove("/buffers/0/uri");
    room.assert_fails(&["buffer 0", "no uri"]);
}

#[test]
fn buffers_of_absurd_size_are_refused_before_they_are_read() {
    let mut room = Fixture::room();
    room.set("/buffers/0/byteLength", json!(1u64 << 60));
    room.assert_fails(&["what its buffers hold", "allow more"]);
}

#[test]
fn a_path_that_is_no_scene_file_is_named() {
    let room = Fixture::room();
    assert_error(
        Scene::load(&room.path("absent.gltf")),
        &["can't be read", "check the path"],
    );
    assert_error(Scene::load(room.folder.path()), &["isn't a file"]);
    assert_error(room.load_bytes("empty.gltf", b""), &["is empty"]);
    assert_error(
        room.load_bytes("picture.gltf", b"\x89PNG\r\n\x1a\n"),
        &["isn't glTF", "JSON"],
    );
    assert_error(
        room.load_bytes("cut.gltf", b"{\"asset\": {\"version\""),
        &["isn't glTF"],
    );
    assert_error(room.load_bytes("list.gltf", b"[1, 2]"), &["isn't glTF 2.0"]);
    assert_error(room.load_bytes("bare.gltf", b"{}"), &["asset.version"]);
    let nested = "[".repeat(1_000_000);
    assert_error(room.load_bytes("nested.gltf", nested.as_bytes()), &["isn't glTF"]);
}

#[test]
fn a_byte_order_mark_is_skipped() {
    let room = Fixture::room();
    room.scene();
    let marked = format!("\u{feff}{}", room.json);
    room.load_bytes("marked.gltf", marked.as_bytes()).expect("it loads");
}

#[test]
fn other_versions_are_refused() {
    let mut room = Fixture::room();
    room.set("/asset/version", json!("1.0"));
    room.assert_fails(&["glTF \"1.0\"", "only 2.0"]);
    room.set("/asset", json!({"version": "2.1", "minVersion": "2.1"}));
    room.assert_fails(&["glTF \"2.1\""]);
    room.set("/asset", json!({"version": "2.1", "minVersion": "2.0"}));
    room.scene();
}

#[test]
fn a_glb_cut_anywhere_is_refused() {
    let room = Fixture::room();
    let glb = room.glb();
    for length in 4..glb.len() {
        assert_error(room.load_bytes("cut.glb", &glb[..length]), &["truncated .glb"]);
    }
}

#[test]
fn wrong_lengths_in_a_glb_are_refused() {
    let room = Fixture::room();
    let with_word = |at: usize, word: u32| {
        let mut glb = room.glb();
        glb[at..at + 4].copy_from_slice(&word.to_le_bytes());
        room.load_bytes("changed.glb", &glb)
    };
    let length = room.glb().len() as u32;
    let json_length = length - 28 - room.binary.len().next_multiple_of(4) as u32;
    assert_error(with_word(4, 1), &[".glb version 1"]);
    assert_error(with_word(8, 0), &["no room for a chunk's header"]);
    assert_error(with_word(8, 16), &["no room for a chunk's header"]);
    assert_error(with_word(8, length + 1), &["truncated .glb"]);
    assert_error(with_word(8, length - 8), &["damaged .glb"]);
    assert_error(with_word(8, u32::MAX), &["truncated .glb"]);
    assert_error(with_word(12, u32::MAX), &["damaged .glb", "are left"]);
    assert_error(with_word(12, 8), &["damaged .glb"]);
    assert_error(with_word(16, 0), &["first chunk isn't JSON"]);
    assert_error(with_word(20 + json_length as usize, u32::MAX), &["damaged .glb"]);
    // A binary chunk of another type is ignored.
    assert_error(
        with_word(24 + json_length as usize, 0),
        &["buffer 0", "no binary chunk"],
    );
}

#[test]
fn further_chunks_of_a_glb_are_skipped() {
    let room = Fixture::room();
    let mut glb = room.glb();
    glb.extend_from_slice(b"\x04\0\0\0MOREdata");
    let length = (glb.len() as u32).to_le_bytes();
    glb[8..12].copy_from_slice(&length);
    room.load_bytes("more.glb", &glb).expect("it loads");
}

#[test]
fn names_with_line_ends_and_megabytes_keep_messages_to_a_line() {
    let mut room = Fixture::room();
    room.set("/nodes/0/name", json!(format!("two\nlines{}", "x".repeat(1 << 20))));
    room.set("/nodes/0/mesh", json!(9));
    room.assert_fails(&["node 0 \"two\\nlinesxxx", "no mesh 9"]);
    room.set("/nodes/0/mesh", json!(0));
    assert!(room.scene().objects[0].name.len() < 200, "names are cut");
}

/// The project's shared scenes, if they exist, must all load or say why not.
#[test]
fn the_shared_scenes_load() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes");
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    for entry in entries {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|extension| extension != "gltf") {
            continue;
        }
        let scene = Scene::load(&path).unwrap_or_else(|error| panic!("{error}"));
        assert!(
            !scene.triangles.is_empty() && scene.environment.is_none(),
            "{}: {:?}",
            path.display(),
            scene.warnings
        );
    }
}

/// JSON schema's integers include 5126.0; some exporters write null members; `extras` may be of any type.
#[test]
fn equivalent_spellings_of_the_schema_load_alike() {
    let plain = Fixture::room().scene();
    for extras in [
        json!("text"),
        json!(7),
        json!(true),
        json!([1, "a"]),
        json!({"a": null}),
        json!(null),
    ] {
        let mut room = Fixture::room();
        for place in [
            "/extras",
            "/asset/extras",
            "/nodes/0/extras",
            "/meshes/0/primitives/0/extras",
        ] {
            room.set(place, extras.clone());
        }
        assert_eq!(room.scene().positions, plain.positions, "extras {extras}");
    }
    let mut room = Fixture::room();
    room.set("/accessors/0/componentType", json!(5126.0));
    room.set("/accessors/0/bufferView", json!(0.0));
    room.set(
        "/buffers/0/byteLength",
        json!(room.json["buffers"][0]["byteLength"].as_f64()),
    );
    room.set("/nodes/0/skin", json!(null));
    room.set("/animations", json!(null));
    room.set("/nodes/0/somethingUnknown", json!({"a": [1.0, null]}));
    let scenes = json!([{"name": "empty"}, room.json["scenes"][0]]);
    room.set("/scenes", scenes);
    room.set("/scene", json!(1.0));
    assert_eq!(room.scene().positions, plain.positions);
}

#[test]
fn a_version_that_is_a_number_and_a_value_of_a_wrong_type_are_named_with_their_place() {
    let mut room = Fixture::room();
    room.set("/asset/version", json!(2.0));
    room.assert_fails(&["asset.version", "not a text"]);
    let mut room = Fixture::room();
    room.set("/nodes/0/mesh", json!("floor"));
    room.assert_fails(&["isn't glTF 2.0", "nodes[0].mesh"]);
}

#[test]
fn padding_that_is_counted_but_missing_is_reported() {
    let mut room = Fixture::room();
    let length = room.binary.len();
    room.set("/buffers/0/byteLength", json!(length + 3));
    room.assert_warns(&["buffer 0", "padding"]);
    room.set("/buffers/0/byteLength", json!(length + 4));
    room.assert_fails(&["buffer 0", "byteLength"]);
}

#[test]
fn json_that_ends_in_nul_characters_loads_with_a_warning() {
    let room = Fixture::room();
    room.scene();
    let json = [room.json.to_string().as_bytes(), b"\0\0\0"].concat();
    let scene = room.load_bytes("padded.gltf", &json).expect("a scene");
    assert!(
        scene.warnings.iter().any(|line| line.contains("NUL")),
        "{:?}",
        scene.warnings
    );
}
