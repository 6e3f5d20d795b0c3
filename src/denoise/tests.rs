//! What happens to pictures before and after the library. The library itself: tests/denoising.rs.

use super::*;

#[test]
fn values_that_are_no_numbers_become_the_mean_around_them() {
    let mut pixels: Vec<[f32; 3]> = (0..9).map(|i| [i as f32, 1.0, 2.0]).collect();
    pixels[4] = [f32::NAN, f32::INFINITY, 2.0];
    pixels[0] = [f32::NEG_INFINITY, 1.0, 2.0];
    let finite = finite(&Image::new(3, 3, pixels.clone()));
    // Around the centre: 1, 2, 3, 5, 6, 7, 8. Around the corner: 1, 3.
    let centre = 32.0f32 / 7.0;
    assert_eq!(finite.pixels()[4], [centre, 1.0, 2.0]);
    assert_eq!(finite.pixels()[0], [2.0, 1.0, 2.0]);
    assert_eq!(finite.pixels()[1..4], pixels[1..4], "others stay");
    let nothing = self::finite(&Image::new(1, 1, vec![[f32::NAN; 3]]));
    assert_eq!(nothing.pixels(), [[0.0; 3]]);
}

#[test]
fn pictures_of_any_brightness_are_scaled_to_a_mean_near_1_and_back_exactly() {
    for brightness in [f32::MIN_POSITIVE, 1e-30, 1e-8, 0.3, 1.0, 7.0, 1e8, 1e36] {
        let picture = Image::new(2, 1, vec![[0.5 * brightness; 3], [1.5 * brightness; 3]]);
        let scale = scale_of(&picture).expect("light");
        let mean = f64::from(brightness) * f64::from(scale);
        assert!(
            (0.7..1.5).contains(&mean) || brightness < 1e-36,
            "{brightness:e}: {mean}"
        );
        let there = scaled(&picture, scale);
        assert_eq!(scaled(&there, 1.0 / scale), picture, "{brightness:e}");
    }
    assert_eq!(scale_of(&Image::new(1, 1, vec![[0.0, -1.0, 0.0]])), None);
}

#[test]
fn the_margin_mirrors_the_picture_and_is_cut_off_again() {
    for [width, height] in [[1, 1], [2, 3], [1, 40], [50, 20]] {
        let pixels = (0..width * height).map(|index| [(index % width) as f32, (index / width) as f32, 1.0]);
        let picture = Image::new(width, height, pixels.collect());
        let wide = with_margin(&picture);
        assert_eq!([wide.width(), wide.height()], [width + 2 * MARGIN, height + 2 * MARGIN]);
        let at = |x: usize, y: usize| wide.pixels()[y * wide.width() + x];
        assert_eq!(
            at(MARGIN - 1, MARGIN),
            picture.pixels()[0],
            "left of the first pixel is the first pixel"
        );
        let last = picture.pixels()[width * height - 1];
        assert_eq!(
            at(MARGIN + width, MARGIN + height),
            last,
            "beyond the last one is the last one"
        );
        let second = [1.min(width - 1) as f32, 0.0, 1.0];
        assert_eq!(at(MARGIN - 2, MARGIN), second, "then the second one");
        assert_eq!(without_margin(&wide, [width, height]), picture);
    }
}
