//! Renders a glTF file with the library: `cargo run --release --example render -- SCENE.gltf OUT.exr`. It shows progress, and
//! ends when the estimated error of the picture is 5 %, or after a minute.

use std::path::Path;
use std::time::Duration;

use ppm_vk::{Error, Hooks, Platform, PreparedScene, RenderConfig, Scene, Session, Until};

fn main() -> Result<(), Error> {
    let mut arguments = std::env::args().skip(1);
    let (Some(file), Some(output)) = (arguments.next(), arguments.next()) else {
        return Err(Error::Config("name a scene and a picture".to_owned()));
    };
    let scene = Scene::load(Path::new(&file))?;
    let camera = &scene.cameras[0];
    let prepared = PreparedScene::new(&scene)?;
    let mut session = Session::new(&prepared, camera, &RenderConfig::of(camera), &Platform::default())?;

    let until = Until {
        time: Some(Duration::from_secs(60)),
        ..Until::error(0.05)
    };
    let hooks = Hooks {
        progress: &|progress| println!("iteration {}: {:.0} %", progress.iterations, 100.0 * progress.done),
        ..Hooks::default()
    };
    let rendered = session.render_with(until, &hooks)?;
    for warning in rendered.warnings() {
        eprintln!("{warning}");
    }
    rendered.write_exr(Path::new(&output))
}
