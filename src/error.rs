//! The library's errors. Each message says in one line what is wrong, where, and what to do about it. None names flags of a
//! program: a program derives them from [`Setting`] and [`Remedy`].

use std::fmt;
use std::path::{Path, PathBuf};

/// Result of a library function.
pub type Result<T> = std::result::Result<T, Error>;

/// Errors of input, environment and device.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A scene file that can't be read, is damaged, or lacks something that rendering needs.
    #[error("{}: {what}", path.display())]
    Scene {
        /// The scene file.
        path: PathBuf,
        /// What is wrong, where in the file, and how to fix it.
        what: String,
    },
    /// A scene or an environment that needs more memory than [`LoadOptions::memory_limit`](crate::LoadOptions::memory_limit).
    #[error("{}: {what}; make it smaller, or allow more", path.display())]
    Memory {
        /// The file.
        path: PathBuf,
        /// The item and its size.
        what: String,
        /// A limit in bytes that would have been sufficient at this point.
        needed: u64,
    },
    /// A setting outside its range, or one that does not fit the scene or the device.
    #[error("{setting} {what}")]
    Setting {
        /// Which one.
        setting: Setting,
        /// Its value, and what is wrong with it.
        what: String,
    },
    /// A request that can't be fulfilled.
    #[error("{0}")]
    Config(String),
    /// A file that can't be read or written.
    #[error("{}: {what}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What failed, and how to fix it.
        what: String,
    },
    /// A device that failed.
    #[error("{0}")]
    Device(String),
    /// No usable Vulkan loader or device, or a device whose limits are exceeded.
    #[error("{what}; {remedy}")]
    Unfit {
        /// What is wrong.
        what: String,
        /// Advice.
        remedy: Remedy,
    },
    /// A Vulkan call that failed.
    #[error("Vulkan: {call} failed: {code}")]
    Vulkan {
        /// The call.
        call: &'static str,
        /// The driver's result code.
        code: String,
    },
}

/// A setting, named as its field in [`RenderConfig`](crate::RenderConfig) or as a property of a lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Setting {
    /// Pixels.
    Resolution,
    /// Photon paths of an iteration.
    Photons,
    /// Eq. 2's α.
    Alpha,
    /// The initial radius.
    Radius,
    /// A part of several.
    Part,
    /// [`RenderConfig::crop`](crate::RenderConfig::crop).
    Crop,
    /// Bounces of a path.
    MaxDepth,
    /// Photons of a grid cell.
    CellPhotons,
    /// How photons are gathered.
    Gather,
    /// Ray tracing method.
    Accel,
    /// A lens's radius.
    Aperture,
    /// The distance of what a lens has in focus.
    Focus,
}

impl fmt::Display for Setting {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        text.write_str(match self {
            Self::Resolution => "resolution",
            Self::Photons => "photons",
            Self::Alpha => "alpha",
            Self::Radius => "radius",
            Self::Part => "part",
            Self::Crop => "crop",
            Self::MaxDepth => "max_depth",
            Self::CellPhotons => "cell_photons",
            Self::Gather => "gather",
            Self::Accel => "accel",
            Self::Aperture => "aperture",
            Self::Focus => "focus",
        })
    }
}

/// Advice for a device whose limits are exceeded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Remedy {
    /// A Vulkan loader, or the CPU.
    InstallLoader,
    /// A Vulkan driver, or the CPU.
    InstallDriver,
    /// Another device, or the CPU.
    AnotherDevice,
    /// Another Vulkan device; the CPU is no alternative here.
    AnotherVulkanDevice,
    /// A device that is named by more of its name, or by its index.
    NameOneDevice,
    /// Open Image Denoise 2, where the system looks for libraries or in a file that is named.
    InstallDenoiser,
    /// Fewer photons or a smaller picture.
    SmallerRender,
    /// A picture of this resolution, another device, or the CPU.
    Resolution([u32; 2]),
    /// A scene with smaller textures, another device, or the CPU.
    SmallerTextures,
    /// A smaller picture of the environment, another device, or the CPU.
    SmallerEnvironment,
    /// A smaller scene, another device, or the CPU.
    SmallerScene,
}

impl fmt::Display for Remedy {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self {
            Self::InstallLoader => "install one (Debian: libvulkan1 mesa-vulkan-drivers)",
            Self::InstallDriver => "install a Vulkan driver (Debian: mesa-vulkan-drivers)",
            Self::InstallDenoiser => {
                return text.write_str("install Open Image Denoise 2 (https://www.openimagedenoise.org)");
            }
            Self::NameOneDevice => return text.write_str("give more of the name, or the index"),
            Self::AnotherVulkanDevice => return text.write_str("use another device"),
            Self::SmallerRender => return text.write_str("try fewer photons or a smaller picture"),
            Self::AnotherDevice => "use another device",
            Self::Resolution([width, height]) => {
                return write!(text, "try {width}x{height} pixels, another device or the CPU");
            }
            Self::SmallerTextures => "make the scene's textures smaller, use another device",
            Self::SmallerEnvironment => "make the environment's picture smaller, use another device",
            Self::SmallerScene => "make the scene smaller, use another device",
        };
        write!(text, "{what} or the CPU")
    }
}

impl Error {
    /// Whether the device was lost: after a driver's reset, another one may be opened.
    pub fn is_device_lost(&self) -> bool {
        matches!(self, Self::Vulkan { code, .. } if code.contains("DEVICE_LOST"))
    }

    /// Whether a device can't render the picture at once, but can render a smaller one, or [crops](crate::crops) of it.
    pub fn is_picture_too_large(&self) -> bool {
        let Self::Unfit { remedy, .. } = self else { return false };
        matches!(remedy, Remedy::Resolution(_))
    }

    /// A device whose limits are exceeded.
    pub(crate) fn unfit(what: impl Into<String>, remedy: Remedy) -> Self {
        Self::Unfit {
            what: one_line(what.into()),
            remedy,
        }
    }

    /// A setting that is wrong.
    pub(crate) fn setting(setting: Setting, what: impl Into<String>) -> Self {
        Self::Setting {
            setting,
            what: what.into(),
        }
    }

    /// An error about the scene file at `path`.
    pub fn scene(path: &Path, what: impl Into<String>) -> Self {
        Self::Scene {
            path: path.to_owned(),
            what: one_line(what.into()),
        }
    }

    /// An error about reading or writing the file at `path`.
    pub fn file(path: &Path, what: impl Into<String>) -> Self {
        Self::File {
            path: path.to_owned(),
            what: one_line(what.into()),
        }
    }
}

/// A message as one line: those of decoders may have several, or end with a line end.
pub(crate) fn one_line(text: String) -> String {
    if !text.contains(['\n', '\r']) {
        return text;
    }
    let lines: Vec<&str> = text
        .split(['\n', '\r'])
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect();
    lines.join(" ")
}
