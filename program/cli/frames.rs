//! The pictures of a render: one, or the frames of an animation, each with files of its own.

use std::path::{Path, PathBuf};

use super::args::RenderArguments;
use super::events::{Event, Events, Frame};
use ppm_vk::Rendered;

/// Frames per second.
const DEFAULT_FPS: f64 = 24.0;
/// Maximum number of frames, far beyond what a process renders: the files of all are checked before the first one.
const MOST_FRAMES: u32 = 100_000;

/// The frames from the first to the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frames {
    first: u32,
    last: u32,
}

impl Frames {
    /// Parses A..B.
    pub fn parse(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse::<u32>().ok();
        let Some((first, last)) = text
            .split_once("..")
            .and_then(|(first, last)| Some((number(first)?, number(last)?)))
        else {
            return Err("expected A..B with whole numbers from 0 on, such as 1..24".to_owned());
        };
        if last < first {
            return Err(format!(
                "the last frame comes before the first; {last}..{first} renders these"
            ));
        }
        if last - first >= MOST_FRAMES {
            return Err(format!(
                "these are more than {MOST_FRAMES} frames; render them in several parts"
            ));
        }
        Ok(Self { first, last })
    }
}

/// The files of a picture.
#[derive(Debug, Clone)]
pub struct RenderFiles {
    pub exr: PathBuf,
    pub png: Option<PathBuf>,
    pub profile_json: Option<PathBuf>,
    pub trace: Option<PathBuf>,
    pub state: Option<PathBuf>,
}

impl RenderFiles {
    /// Those that the arguments name.
    fn of(arguments: &RenderArguments, exr: &Path) -> Self {
        Self {
            exr: exr.to_owned(),
            png: arguments.png.clone(),
            profile_json: arguments.profile_json.clone(),
            trace: arguments.trace.clone(),
            state: arguments.state.clone(),
        }
    }

    /// The same of a frame.
    fn of_frame(&self, frame: u32) -> Self {
        let of_frame = |file: &Option<PathBuf>| file.as_deref().map(|file| numbered(file, frame));
        Self {
            exr: numbered(&self.exr, frame),
            png: of_frame(&self.png),
            profile_json: of_frame(&self.profile_json),
            trace: of_frame(&self.trace),
            state: of_frame(&self.state),
        }
    }

    /// All of them.
    pub fn all(&self) -> impl Iterator<Item = &Path> {
        let others = [&self.png, &self.profile_json, &self.trace, &self.state];
        std::iter::once(&*self.exr).chain(others.into_iter().filter_map(|file| file.as_deref()))
    }
}

/// NAME.####.ENDING: the number before the last ending, with four digits or more.
fn numbered(file: &Path, frame: u32) -> PathBuf {
    let mut name = file.file_stem().unwrap_or_default().to_owned();
    name.push(format!(".{frame:04}"));
    if let Some(ending) = file.extension() {
        name.push(".");
        name.push(ending);
    }
    file.with_file_name(name)
}

/// A picture to render.
#[derive(Debug, Clone)]
pub struct Shot {
    /// The frame of an animation that it is.
    pub frame: Option<Frame>,
    /// The time in the scene's animations, in seconds.
    pub time: Option<f64>,
    /// When the shutter opens and closes, if there is motion blur.
    pub shutter: Option<[f64; 2]>,
    /// Its files.
    pub files: RenderFiles,
}

impl Shot {
    /// Those that the arguments ask for.
    pub fn all(arguments: &RenderArguments, exr: &Path) -> Vec<Self> {
        let files = RenderFiles::of(arguments, exr);
        let fps = arguments.fps.unwrap_or(DEFAULT_FPS);
        let shutter = |time| Some(arguments.shutter?.around(time, fps));
        let Some(Frames { first, last }) = arguments.frames else {
            return vec![Self {
                frame: None,
                time: arguments.read.frame_time,
                shutter: arguments.read.frame_time.and_then(shutter),
                files,
            }];
        };
        let of_frame = |frame| {
            let time = f64::from(frame) / fps;
            let files = files.of_frame(frame);
            Self {
                frame: Some(Frame {
                    frame,
                    first,
                    last,
                    time,
                }),
                time: Some(time),
                shutter: shutter(time),
                files,
            }
        };
        (first..=last).map(of_frame).collect()
    }

    /// Tells that it begins, if it is a frame.
    pub fn begin(&self, events: &Events) {
        if let Some(frame) = self.frame {
            say!(
                "frame {} of {}..{}, at {:.6} s",
                frame.frame,
                frame.first,
                frame.last,
                frame.time
            );
            events.tell(&Event::Frame(frame));
        }
    }

    /// Tells that it is done, if it is a frame, and how it differs from the frame before it. `same_as`: the frame whose picture it
    /// has.
    pub fn tell_done(&self, events: &Events, rendered: &Rendered, before: Option<&Rendered>, same_as: Option<u32>) {
        let Some(Frame { frame, .. }) = self.frame else { return };
        let flicker = before.and_then(|before| rendered.flicker(before));
        if let Some(same_as) = same_as {
            say!("frame {frame}: nothing has moved since frame {same_as}, whose picture it has");
        } else if let Some(flicker) = flicker {
            say!("frame {frame} after frame {}: {flicker}", frame - 1);
        }
        events.tell(&Event::FrameDone {
            frame,
            same_as,
            estimated_error: rendered.error().map(|error| error.total),
            flicker,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_has_its_number_before_the_ending() {
        for (file, frame, expected) in [
            ("out/a.exr", 7, "out/a.0007.exr"),
            ("a.b.png", 12345, "a.b.12345.png"),
            ("profile", 0, "profile.0000"),
        ] {
            assert_eq!(numbered(Path::new(file), frame), Path::new(expected));
        }
    }

    #[test]
    fn ranges_are_inclusive_and_go_forward() {
        assert_eq!(Frames::parse("3..3"), Ok(Frames { first: 3, last: 3 }));
        for (text, word) in [
            ("5..3", "3..5"),
            ("-1..3", "from 0 on"),
            ("3", "A..B"),
            ("1..x", "A..B"),
            ("0..4000000000", "100000"),
        ] {
            let error = Frames::parse(text).expect_err(text);
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
