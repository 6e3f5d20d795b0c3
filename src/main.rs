fn main() {
    let args: Vec<String> = std::env::args().collect();
    let path = std::path::PathBuf::from(&args[1]);
    let get = |name: &str| args.iter().position(|a| a == name).map(|i| args[i + 1].clone());
    let iterations: u32 = get("--iterations").map_or(16, |s| s.parse().unwrap());
    let scene = ppm_vk::scene::Scene::load(&path).unwrap();
    for w in &scene.warnings { eprintln!("warning: {w}"); }
    let packed = ppm_vk::scene::PackedScene::new(&scene).unwrap();
    let mut config = ppm_vk::config::RenderConfig { resolution: [256, 256], ..Default::default() };
    if let Some(g) = get("--gather") { config.gather = ppm_vk::gather::method(&g).unwrap(); }
    if let Some(r) = get("--radius") { config.radius = Some(r.parse().unwrap()); }
    if let Some(r) = get("--photons") { config.photons = r.parse().unwrap(); }
    if get("--direct").is_some_and(|d| d == "photons") { config.direct = ppm_vk::config::Direct::Photons; }
    if get("--estimator").is_some_and(|d| d == "ppm") { config.estimator = ppm_vk::config::Estimator::Ppm; }
    if get("--accel").is_some_and(|d| d == "brute") { config.accel = ppm_vk::config::Accel::Brute; }
    let device = ppm_vk::gpu::Device::open(None).unwrap();
    eprintln!("{:?} loop limit {}", device.summary(), device.loop_limit());
    let mut r = ppm_vk::pipeline::Renderer::new(device, &packed, &scene.cameras[0], config).unwrap();
    eprintln!("radius {} render units, {} scene units", r.radius(), r.radius() as f64 / packed.scale);
    let mut times: std::collections::BTreeMap<&str, (f64, u32)> = Default::default();
    let start = std::time::Instant::now();
    let mut wall = 0.0;
    for _ in 0..iterations {
        let run = r.iterate().unwrap();
        wall += run.wall.as_secs_f64();
        for l in run.launches { let e = times.entry(l.stage).or_default(); e.0 += l.duration_ns; e.1 += 1; }
    }
    eprintln!("{:.4} s/iteration, submissions {:.4}", start.elapsed().as_secs_f64() / iterations as f64, wall / iterations as f64);
    for (k, v) in times { eprintln!("{k:16} {:8.3} ms/iteration  {} launches", v.0 * 1e-6 / iterations as f64, v.1); }
    eprintln!("{:?}", r.counters());
    let image = r.resolve().unwrap();
    if let Some(reference) = get("--reference") {
        let reference = ppm_vk::film::read_exr(std::path::Path::new(&reference)).unwrap();
        println!("{:?}", ppm_vk::metrics::compare(&image, &reference));
    }
    if let Some(p) = get("--png") { ppm_vk::film::write_png(&image, std::path::Path::new(&p), 0.0).unwrap(); }
}
