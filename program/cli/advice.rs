//! Messages of the library with the command line's flags, by the kinds of errors and warnings.

use anyhow::{Error, anyhow};
use ppm_vk::{Failure, LoadChoice, Remark, Remedy, Warning};

/// An error in one line.
pub fn line(error: &Error) -> String {
    let mut causes = error.chain().map(|cause| {
        cause
            .downcast_ref::<ppm_vk::Error>()
            .map_or_else(|| cause.to_string(), of_library)
    });
    let first = causes.next().unwrap_or_default();
    causes.fold(first, |line, cause| format!("{line}: {cause}"))
}

/// The same for an error of the library.
pub fn of_library(error: &ppm_vk::Error) -> String {
    use ppm_vk::Error::{Memory, Setting, Unfit};
    match error {
        Memory { needed, .. } => format!("{error}, such as --memory-limit {}", needed.div_ceil(1 << 30)),
        Setting { setting, what } => format!("--{} {what}", setting.to_string().replace('_', "-")),
        Unfit { what, remedy } => format!("{what}; {}", of_remedy(*remedy)),
        other => other.to_string(),
    }
}

fn of_remedy(remedy: Remedy) -> String {
    const OR_CPU: &str = "or use another --device or --backend cpu";
    match remedy {
        Remedy::InstallLoader => "install one (Debian: libvulkan1 mesa-vulkan-drivers) or use --backend cpu".to_owned(),
        Remedy::InstallDriver => "install a driver (Debian: mesa-vulkan-drivers) or use --backend cpu".to_owned(),
        Remedy::InstallDenoiser => format!(
            "install Open Image Denoise 2 (https://www.openimagedenoise.org, or pip install pyoidn), name the file of its library \
             by {}, or leave out --denoise",
            super::denoise::LIBRARY
        ),
        Remedy::AnotherDevice => {
            "pick another with --device (ppm-vk devices lists them) or use --backend cpu".to_owned()
        }
        Remedy::AnotherVulkanDevice => "pick another with --device".to_owned(),
        Remedy::SmallerRender => "try fewer --photons or a smaller --resolution".to_owned(),
        Remedy::Resolution([width, height]) => {
            format!("try --resolution {width}x{height}, or another --device or --backend cpu")
        }
        Remedy::SmallerTextures => format!("make the scene's textures smaller, {OR_CPU}"),
        Remedy::SmallerEnvironment => format!("make the environment's picture smaller, {OR_CPU}"),
        Remedy::SmallerScene => format!("make the scene smaller, {OR_CPU}"),
        other => other.to_string(),
    }
}

/// The failure that ended a render early.
pub fn of_failure(failure: &Failure) -> Error {
    anyhow!("{}: {}", of_library(&failure.error), failure.consequence())
}

/// A remark about a scene.
pub fn of_remark(remark: &Remark) -> String {
    let flag = match remark.choice() {
        Some(LoadChoice::FrameTime) => "--frame-time SECONDS applies them, --frames A..B renders several",
        Some(LoadChoice::Environment) => "--environment sets another one",
        Some(LoadChoice::Scene) => "--scene-name chooses another one",
        Some(LoadChoice::LightUnits) => "--light-units spec",
        Some(LoadChoice::SolidGlass) => "--solid-glass takes closed meshes of it as solid",
        _ => return remark.to_string(),
    };
    format!("{remark} ({flag})")
}

/// A warning about a picture, with advice.
pub fn of_warning(warning: &Warning) -> String {
    let flag = match warning {
        Warning::KeptChoices => "; use --estimator sppm",
        Warning::Truncated { .. } if warning.is_slight() => " (--max-depth)",
        Warning::Truncated { .. } => ": raise --max-depth",
        Warning::Cut { .. } => ": use another --device or --backend cpu",
        Warning::Lost { .. } => ": raise or leave out --cell-photons",
        Warning::NonFinite { .. } => "; scale its lights down, and raise --exposure",
        _ => "",
    };
    format!("{warning}{flag}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use ppm_vk::Setting;

    #[test]
    fn a_device_that_cannot_do_it_is_told_with_flags_that_help() {
        let unfit = |remedy| ppm_vk::Error::Unfit {
            what: "device Small Card binds 1 MiB at most".to_owned(),
            remedy,
        };
        for (remedy, flags) in [
            (Remedy::InstallLoader, &["--backend cpu"][..]),
            (Remedy::InstallDriver, &["--backend cpu"]),
            (Remedy::InstallDenoiser, &["PPM_VK_OIDN", "--denoise"]),
            (Remedy::AnotherDevice, &["--device", "--backend cpu"]),
            (Remedy::AnotherVulkanDevice, &["--device"]),
            (Remedy::SmallerRender, &["--photons", "--resolution"]),
            (
                Remedy::Resolution([640, 480]),
                &["--resolution 640x480", "--device", "--backend cpu"],
            ),
            (Remedy::SmallerTextures, &["--device", "--backend cpu"]),
            (Remedy::SmallerEnvironment, &["--device", "--backend cpu"]),
            (Remedy::SmallerScene, &["--device", "--backend cpu"]),
        ] {
            let line = line(&unfit(remedy).into());
            assert!(line.starts_with("device Small Card"), "{line}");
            assert!(flags.iter().all(|flag| line.contains(flag)), "{remedy:?}: {line}");
        }
    }

    #[test]
    fn a_setting_is_told_by_its_flag() {
        let error = ppm_vk::Error::Setting {
            setting: Setting::MaxDepth,
            what: "0: must be at least 1".to_owned(),
        };
        let error = Error::from(error).context("a.exr");
        assert_eq!(line(&error), "a.exr: --max-depth 0: must be at least 1");
    }

    #[test]
    fn memory_that_is_missing_is_told_with_a_limit_that_suffices() {
        let error = ppm_vk::Error::Memory {
            path: "room.glb".into(),
            what: "image 3 needs 2.0 GiB".to_owned(),
            needed: (3 << 30) + 1,
        };
        assert!(of_library(&error).ends_with("--memory-limit 4"), "{error}");
    }
}
