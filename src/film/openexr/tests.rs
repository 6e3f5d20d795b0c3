//! What is written is read again, by this program and as others write it.

use super::read::decode;
use super::*;
use crate::metrics;
use exr::block::samples::Sample;
use exr::image::{AnyChannel, AnyChannels, FlatSamples};
use exr::meta::MetaData;
use exr::meta::attribute::IntegerBounds;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

fn metadata() -> Metadata {
    Metadata {
        iterations: 256,
        photons_emitted: u64::MAX,
        seed: 1 << 53 | 1,
        device: "llvmpipe (LLVM 15, 256 bits) – µ".to_owned(),
        seconds: 12.3456789012345,
        estimated_error: None,
        denoised_by: None,
    }
}

/// A picture with values that a lossy or half-float file would not keep.
fn picture() -> Image {
    let (width, height) = (3, 21);
    let pixels = (0..width * height)
        .map(|i| [i as f32 / 3.0, 1e-30 * i as f32, 1e30 - i as f32])
        .collect();
    Image::new(width, height, pixels)
}

fn written(image: &Image, metadata: &Metadata) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("out.exr");
    write_exr(image, Additions::default(), &path, metadata).expect("an EXR file");
    (folder, path)
}

fn attributes(path: &Path) -> LayerAttributes {
    let meta = MetaData::read_from_file(path, true).expect("a header");
    meta.headers[0].own_attributes.clone()
}

/// The error's one line.
fn line<T>(result: Result<T>) -> String {
    let line = result.err().expect("an error").to_string();
    assert!(!line.contains('\n'), "not one line: {line}");
    line
}

#[test]
fn an_exr_keeps_every_bit_of_every_pixel() {
    let mut image = picture();
    image.pixels[5] = [f32::NAN, f32::INFINITY, -0.0];
    let (_folder, path) = written(&image, &metadata());
    let read = read_exr(&path).expect("a picture");
    assert_eq!((read.width, read.height), (image.width, image.height));
    let bits = |image: &Image| image.pixels.iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>();
    assert_eq!(bits(&read), bits(&image));
}

/// Blender takes a file with a dot in a name for one of several layers, and gives no pixels of it.
#[test]
fn channels_are_named_so_that_others_read_one_picture() {
    let image = picture();
    let alpha: Vec<f32> = (0..image.pixels.len()).map(|i| i as f32 / 100.0).collect();
    let layers = Additions {
        alpha: Some(&alpha),
        errors: Some(&image),
        noisy: Some(&image),
        ..Additions::default()
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("out.exr");
    write_exr(&image, layers, &path, &metadata()).expect("an EXR file");
    let file = exr::prelude::read_first_flat_layer_from_file(&path).expect("a picture");
    let channels = &file.layer_data.channel_data.list;
    let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
    assert_eq!(
        names,
        [
            "A", "B", "G", "R", "error_B", "error_G", "error_R", "noisy_B", "noisy_G", "noisy_R"
        ]
    );
    assert_eq!(channels[0].sample_data, FlatSamples::F32(alpha));
    assert_eq!(read_exr(&path).expect("a picture"), image);
}

#[test]
fn the_header_says_how_the_picture_was_made() {
    let (_folder, path) = written(&picture(), &metadata());
    let own = attributes(&path);
    let text = |name: &str| match own.other.get(&Text::from(name)) {
        Some(AttributeValue::Text(text)) => String::from_utf8(text.as_slice().to_vec()).expect("UTF-8"),
        other => panic!("attribute {name} is {other:?}"),
    };
    let expected = metadata();
    assert_eq!(text("iterations"), "256");
    assert_eq!(text("photonsEmitted"), u64::MAX.to_string(), "not exact");
    assert_eq!(text("seed"), expected.seed.to_string(), "not exact");
    assert_eq!(text("device"), expected.device);
    let seconds = own.other.get(&Text::from("seconds"));
    assert_eq!(seconds, Some(&AttributeValue::F64(expected.seconds)));
    let software = own.software_name.map(|name| name.to_string());
    assert_eq!(software, Some(format!("ppm-vk {}", env!("CARGO_PKG_VERSION"))));
    let meta = MetaData::read_from_file(&path, true).expect("a header");
    assert_eq!(meta.headers[0].shared_attributes.chromaticities, Some(REC_709));
}

#[test]
fn the_estimated_error_is_written_only_where_it_is_known() {
    let error = |metadata: &Metadata| {
        let (_folder, path) = written(&picture(), metadata);
        attributes(&path).other.remove(&Text::from("estimatedError"))
    };
    assert_eq!(error(&metadata()), None);
    let known = Metadata {
        estimated_error: Some(0.01),
        ..metadata()
    };
    assert_eq!(error(&known), Some(AttributeValue::F64(0.01)));
}

#[test]
fn what_removed_the_noise_is_written() {
    let denoised = Metadata {
        denoised_by: Some("Open Image Denoise 2.0.0".to_owned()),
        ..metadata()
    };
    let (_folder, path) = written(&picture(), &denoised);
    let by = attributes(&path).other.remove(&Text::from("denoisedBy"));
    let expected = Text::new_or_panic("Open Image Denoise 2.0.0");
    assert_eq!(by, Some(AttributeValue::Text(expected)));
}

#[test]
fn the_same_picture_and_metadata_give_the_same_bytes() {
    let bytes = || {
        let (_folder, path) = written(&picture(), &metadata());
        fs::read(path).expect("a file")
    };
    let first = bytes();
    for _ in 0..8 {
        assert!(bytes() == first, "look at sort_attributes");
    }
}

/// Writes an EXR file with the `exr` crate: channels of one sample type, and where the data and the picture lie.
fn foreign(names: &[&str], sample: Sample, data: IntegerBounds, display: IntegerBounds) -> (TempDir, PathBuf) {
    let count = data.size.area();
    let samples = || match sample {
        Sample::F16(value) => FlatSamples::F16(vec![value; count]),
        Sample::F32(value) => FlatSamples::F32(vec![value; count]),
        Sample::U32(value) => FlatSamples::U32(vec![value; count]),
    };
    let channels = names.iter().map(|&name| AnyChannel::new(name, samples()));
    let layer = Layer::new(
        data.size,
        LayerAttributes::default().with_position(data.position),
        Encoding::FAST_LOSSLESS,
        AnyChannels::sort(channels.collect()),
    );
    let mut image = exr::image::Image::from_layer(layer);
    image.attributes.display_window = display;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("foreign.exr");
    image.write().to_file(&path).expect("an EXR file");
    (folder, path)
}

#[test]
fn half_float_and_integer_channels_are_read_with_or_without_alpha() {
    let window = IntegerBounds::new((0, 0), (5, 3));
    let expected = Image::new(5, 3, vec![[2.0; 3]; 15]);
    let half = Sample::F16(exr::prelude::f16::from_f32(2.0));
    let float = Sample::F32(2.0);
    for (kind, (_folder, path)) in [
        ("half", foreign(&["A", "B", "G", "R"], half, window, window)),
        ("float", foreign(&["R", "G", "B", "Z"], float, window, window)),
        ("integer", foreign(&["R", "G", "B"], Sample::U32(2), window, window)),
    ] {
        assert_eq!(read_exr(&path).expect(kind), expected, "{kind}");
    }
}

#[test]
fn luminance_alone_is_grey_and_colours_are_preferred_to_it() {
    let window = IntegerBounds::new((0, 0), (5, 3));
    let half = Sample::F16(exr::prelude::f16::from_f32(0.5));
    for names in [&["Y"][..], &["A", "Y"], &["B", "G", "R", "Y"]] {
        let (_folder, path) = foreign(names, half, window, window);
        assert_eq!(
            read_exr(&path).expect("a picture").pixels,
            vec![[0.5; 3]; 15],
            "{names:?}"
        );
    }
}

#[test]
fn a_picture_is_its_display_window() {
    let display = IntegerBounds::new((10, 20), (3, 2));
    let lit = |data: IntegerBounds| {
        let (_folder, path) = foreign(&["R", "G", "B"], Sample::F32(1.0), data, display);
        let image = read_exr(&path).expect("a picture");
        assert_eq!((image.width, image.height), (3, 2));
        image.pixels.iter().map(|pixel| pixel[0]).collect::<Vec<_>>()
    };
    let covering = lit(IntegerBounds::new((8, 19), (9, 9)));
    assert_eq!(covering, [1.0; 6], "data around the picture is cut");
    let corner = lit(IntegerBounds::new((11, 21), (9, 9)));
    assert_eq!(corner, [0.0, 0.0, 0.0, 0.0, 1.0, 1.0], "what is missing is black");
    let outside = lit(IntegerBounds::new((-5, -5), (2, 2)));
    assert_eq!(outside, [0.0; 6]);
}

#[test]
fn a_file_that_is_no_rgb_exr_is_one_clear_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = folder.path().join("text.exr");
    fs::write(&text, "no picture at all").expect("a file");
    let window = IntegerBounds::new((0, 0), (5, 3));
    let (_chroma_folder, chroma) = foreign(&["BY", "RY", "Y"], Sample::F32(1.0), window, window);
    let missing = folder.path().join("missing.exr");
    for (path, expected) in [
        (text.as_path(), "can't be read as OpenEXR"),
        (
            chroma.as_path(),
            "has neither channels R, G and B nor luminance Y alone",
        ),
        (missing.as_path(), "can't be opened"),
        (folder.path(), "can't be"),
    ] {
        let error = line(read_exr(path));
        assert!(error.contains(expected), "{}: {error}", path.display());
    }
}

/// The error of decoding `bytes`, or none.
fn decoding_error(bytes: &[u8]) -> Option<String> {
    let result = decode(Cursor::new(bytes), Path::new("damaged.exr"));
    result.is_err().then(|| line(result))
}

#[test]
fn a_truncated_exr_is_one_line_at_any_length() {
    let (_folder, path) = written(&picture(), &metadata());
    let whole = fs::read(path).expect("a file");
    for length in 0..whole.len() {
        let error = decoding_error(&whole[..length]).unwrap_or_default();
        assert!(error.contains("can't be read as OpenEXR"), "{length} bytes: {error}");
    }
}

#[test]
fn a_damaged_exr_never_panics() {
    let (_folder, path) = written(&picture(), &metadata());
    let whole = fs::read(path).expect("a file");
    for position in 0..whole.len() {
        for bit in [0x08, 0x80] {
            let mut bytes = whole.clone();
            bytes[position] ^= bit;
            // Not all damage shows: a letter of the device's name, say.
            decoding_error(&bytes);
        }
    }
}

#[test]
fn an_absurd_size_is_refused_before_memory_is_asked_for() {
    let (_folder, path) = written(&picture(), &metadata());
    let original = fs::read(path).expect("a file");
    for (width, height, expected) in [
        (1 << 24, 1 << 24, "more than 134 million"),
        // All lines of a block are decoded together.
        (1 << 22, 16u32, "blocks of more than 64 MiB"),
    ] {
        let mut bytes = original.clone();
        let mut set = |attribute: &[u8], offset: usize, values: &[u32]| {
            let name = bytes.windows(attribute.len()).position(|window| window == attribute);
            let value = name.expect("the attribute") + attribute.len() + 4 + offset;
            bytes[value..value + 4 * values.len()].copy_from_slice(bytemuck::cast_slice(values));
        };
        set(b"dataWindow\0box2i\0", 8, &[width - 1, height - 1]);
        set(b"displayWindow\0box2i\0", 8, &[width - 1, height - 1]);
        set(b"chunkCount\0int\0", 0, &[height.div_ceil(16)]);
        let error = decoding_error(&bytes).unwrap_or_default();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn the_references_have_the_means_that_their_notes_state() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/references");
    let Ok(entries) = fs::read_dir(folder) else {
        return; // only where the references are
    };
    let paths = entries.map(|entry| entry.expect("an entry").path());
    for path in paths.filter(|path| path.extension().is_some_and(|e| e == "exr")) {
        let image = read_exr(&path).expect("a reference");
        let note = fs::read(path.with_extension("json")).expect("a note");
        let note: serde_json::Value = serde_json::from_slice(&note).expect("JSON");
        let resolution = note["resolution"].as_str().unwrap_or("256x256");
        assert_eq!(
            format!("{}x{}", image.width, image.height),
            resolution,
            "{}",
            path.display()
        );
        for (channel, mean) in metrics::mean(&image).into_iter().enumerate() {
            let Some(stated) = note["mean"][channel].as_f64() else {
                continue; // pool's note states none
            };
            let difference = (mean - stated).abs();
            assert!(difference < 1e-4, "{} {channel}: {mean}, not {stated}", path.display());
        }
    }
}
