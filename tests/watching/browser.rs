//! The page of `--serve` in a browser: Chromium without a window, where it is installed.

use std::path::{Path, PathBuf};
use std::process::Command;

use image::RgbImage;

use super::page::{serve, status_with_error};

fn chromium() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let folders: Vec<_> = std::env::split_paths(&path).collect();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    names
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)))
        .find(|file| file.is_file())
}

/// What a browser makes of a page: its picture, its elements, and its messages.
struct Seen {
    picture: RgbImage,
    elements: String,
    messages: String,
}

fn look(browser: &Path, folder: &Path, name: &str, url: &str) -> Seen {
    let shot = folder.join(name);
    let run = |more: &[&str]| {
        let output = Command::new(browser)
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--no-first-run",
                "--disable-extensions",
            ])
            .args([
                "--window-size=1100,700",
                "--virtual-time-budget=3000",
                "--enable-logging=stderr",
            ])
            .arg(format!("--user-data-dir={}", folder.join("profile").display()))
            .args(more)
            .arg(url)
            .output()
            .expect("a browser runs");
        (
            String::from_utf8_lossy(&output.stdout).into_owned(),
            String::from_utf8_lossy(&output.stderr).into_owned(),
        )
    };
    let (_, messages) = run(&[&format!("--screenshot={}", shot.display())]);
    let (page, more) = run(&["--dump-dom"]);
    // Without its script, which has the same words.
    let elements = page.split("<script").next().unwrap_or_default().to_owned();
    let picture = image::open(&shot)
        .unwrap_or_else(|error| panic!("{error}: {messages}"))
        .into_rgb8();
    Seen {
        picture,
        elements,
        messages: messages + &more,
    }
}

/// The mean of the pixels where the page shows the render.
fn mean(picture: &RgbImage) -> [f64; 3] {
    let pixels = (200..500).flat_map(|y| (200..500).map(move |x| picture.get_pixel(x, y).0));
    let sum = pixels.fold([0.0; 3], |sum, pixel| {
        std::array::from_fn(|i| sum[i] + f64::from(pixel[i]))
    });
    sum.map(|sum| sum / 9e4)
}

#[test]
#[ignore = "needs Chromium: scripts/test --long"]
fn a_browser_shows_the_page() {
    let Some(browser) = chromium() else {
        eprintln!("skipped: there is no Chromium (Debian: chromium)");
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let (_running, port) = serve(
        folder.path(),
        &["--time", "1000", "--resolution", "320x240", "--max-depth", "1"],
    );
    status_with_error(port);
    let at = |hash: &str| format!("http://127.0.0.1:{port}/{hash}");
    let plain = look(&browser, folder.path(), "plain.png", &at(""));
    let bright = look(&browser, folder.path(), "bright.png", &at("#exposure=2"));
    let error = look(&browser, folder.path(), "error.png", &at("#show=error"));
    if let Some(kept) = std::env::var_os("PPM_VK_SCREENSHOTS") {
        for name in ["plain.png", "bright.png", "error.png"] {
            std::fs::copy(folder.path().join(name), Path::new(&kept).join(name)).expect("a copy");
        }
    }
    for seen in [&plain, &bright, &error] {
        for word in ["CONSOLE", "Content Security Policy", "Uncaught"] {
            assert!(!seen.messages.contains(word), "{}", seen.messages);
        }
        for text in [
            "o.exr",
            "rendering",
            "estimated error",
            "gather_clustered",
            "photon paths",
        ] {
            assert!(seen.elements.contains(text), "«{text}» isn't in:\n{}", seen.elements);
        }
        assert!(seen.elements.contains(r#"<div id="empty"></div>"#), "{}", seen.elements);
    }
    let [plain, bright, error] = [plain, bright, error].map(|seen| mean(&seen.picture));
    for channel in 0..3 {
        assert!(plain[channel] > 40.0, "a lit room: {plain:?}");
        assert!(
            bright[channel] > plain[channel] + 30.0,
            "four times as bright: {plain:?}, {bright:?}"
        );
        assert!(
            error[channel] < plain[channel] - 20.0,
            "its error is darker: {plain:?}, {error:?}"
        );
    }
}
