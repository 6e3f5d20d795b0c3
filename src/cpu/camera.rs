//! Camera rays: follows each pixel's path over mirrors and glass to its visible points.

use std::f64::consts::PI;

use bytemuck::Zeroable;
use glam::DVec3;
use rayon::prelude::*;

use super::boundary::Boundary;
use super::contact::{Encounter, choose_part, has_coat, is_mixed};
use super::dispersion::disperse;
use super::environment::Environment;
use super::glint::{glint, soft_lights_along};
use super::gloss::Reflector;
use super::intersect::{PlacedTriangle, Ray};
use super::light::{emits, emitted_radiance};
use super::media::{Media, transmittance};
use super::sampling::{disc_point, encode_direction};
use super::surface::{Facing, Surface};
use super::texture::{nearest_seen, nearest_visible};
use super::tiles::{pixel_of, pixel_slots};
use super::vector::{rgb, with_word, xyz};
use super::{Counts, FAR, Inputs};
use crate::config::Estimator;
use crate::layout::{FOLLOWED_ALPHA, GLOSSY_SURFACE, Gloss, MATTE, MIRROR, NO_OBJECT, VisiblePoint};
use crate::random::{CameraTurn, PathKind, Random};

/// What is left of a path that splits.
#[derive(Clone, Copy)]
struct Branch {
    ray: Ray,
    throughput: DVec3,
    emitted: DVec3,
    /// From the camera so far.
    way: f64,
    depth: u32,
    ignored: Option<PlacedTriangle>,
    /// That it is in.
    media: Media,
    /// Of its light, nm.
    wavelength: Option<f64>,
    /// What a boundary that didn't split the path reflects of the lights' own radiance has been seen.
    reflection_seen: bool,
    /// What the next surface emits has been seen.
    emission_seen: bool,
    /// What lights with an extent send along the ray has been seen.
    lamps_seen: bool,
}

/// Radiance of the first surface on a ray's way, and whether nothing is there that scatters light.
fn glimpse(
    inputs: &Inputs<'_>,
    ray: Ray,
    ignored: Option<PlacedTriangle>,
    media: Media,
    lamps_seen: bool,
    random: &Random,
) -> (DVec3, bool) {
    let hit = nearest_visible(inputs, ray, FAR, ignored, random);
    let lamps = if lamps_seen {
        DVec3::ZERO
    } else {
        soft_lights_along(inputs, ray, hit.map_or(FAR, |hit| hit.t), media)
    };
    let Some(hit) = hit else {
        let sky = Environment::of(&inputs.scene.environment).at(ray.direction);
        return (sky.radiance + lamps, true);
    };
    let met = Encounter::new(inputs, hit, ray.direction, media, false, random);
    let material = met.surface.material;
    let dark = material.surface == MATTE && rgb(material.base_color).max_element() == 0.0;
    if emits(&material, met.facing.front) {
        let emission = emitted_radiance(&material, -ray.direction.dot(met.facing.geometric_normal));
        (emission * transmittance(inputs, met.through, hit.t) + lamps, dark)
    } else {
        (lamps, dark)
    }
}

/// Visible points, in slot order: as many for each pixel slot as
/// [`Settings::slots_per_pixel`](crate::layout::Settings::slots_per_pixel) says.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    /// Where camera paths end.
    pub points: Vec<VisiblePoint>,
    /// How those scatter; empty where the scene has no glossy surfaces.
    pub gloss: Vec<Gloss>,
    /// Side of the pixel where each visible point is, render units.
    pub footprints: Vec<f32>,
}

/// What gathers read of it, borrowed.
#[derive(Debug, Clone, Copy)]
pub struct SeenSlice<'a> {
    pub(super) points: &'a [VisiblePoint],
    pub(super) gloss: &'a [Gloss],
}

impl<'a> From<&'a Seen> for SeenSlice<'a> {
    fn from(Seen { points, gloss, .. }: &'a Seen) -> Self {
        Self { points, gloss }
    }
}

/// Of a scene without glossy surfaces.
impl<'a> From<&'a [VisiblePoint]> for SeenSlice<'a> {
    fn from(points: &'a [VisiblePoint]) -> Self {
        Self { points, gloss: &[] }
    }
}

/// Of a scene without glossy surfaces.
impl<'a> From<&'a Vec<VisiblePoint>> for SeenSlice<'a> {
    fn from(points: &'a Vec<VisiblePoint>) -> Self {
        points.as_slice().into()
    }
}

impl SeenSlice<'_> {
    /// Whether a slot's material is coated.
    pub(super) fn is_coated(&self, slot: usize) -> bool {
        self.gloss.get(slot).is_some_and(Reflector::is_coated)
    }

    /// How a slot's surface scatters and the direction to the viewer, in a scene with glossy surfaces.
    pub(super) fn reflector(&self, slot: usize) -> Option<(Reflector, DVec3)> {
        self.gloss.get(slot).map(Reflector::from_gloss)
    }
}

/// A slot in the making.
#[derive(Clone, Copy)]
struct Slot {
    point: VisiblePoint,
    gloss: Gloss,
    footprint: f32,
}

/// The visible points of one of an iteration's paths of each pixel.
pub fn camera(inputs: &Inputs<'_>, turn: CameraTurn, counts: &Counts) -> Seen {
    let slots_per_pixel = inputs.settings.slots_per_pixel as usize;
    let mut slots = vec![nothing_seen(DVec3::ZERO, false); pixel_slots(inputs.settings) * slots_per_pixel];
    slots
        .par_chunks_mut(slots_per_pixel)
        .enumerate()
        .for_each(|(pixel_slot, slots)| {
            if let Some(pixel) = pixel_of(inputs.settings.resolution, pixel_slot as u32) {
                follow(inputs, pixel, turn, slots, counts);
            }
        });
    let glossy = inputs.scene.features.glossy;
    Seen {
        points: slots.iter().map(|slot| slot.point).collect(),
        gloss: slots.iter().filter(|_| glossy).map(|slot| slot.gloss).collect(),
        footprints: slots.iter().map(|slot| slot.footprint).collect(),
    }
}

/// A visible point whose path met no matte surface, though perhaps another one.
fn nothing_seen(emitted: DVec3, met_surface: bool) -> Slot {
    let point = VisiblePoint {
        position_object: with_word(DVec3::ZERO, NO_OBJECT),
        weight_normal: with_word(DVec3::ZERO, met_surface.into()),
        emitted_normal: with_word(emitted, 0),
    };
    Slot {
        point,
        gloss: Gloss::zeroed(),
        footprint: 0.0,
    }
}

/// The visible point of a path that ends on a surface.
fn seen(inputs: &Inputs<'_>, branch: &Branch, surface: &Surface, facing: &Facing, reflector: Reflector) -> Slot {
    if reflector.diffuse.max_element() == 0.0 && reflector.alpha == 0.0 {
        return nothing_seen(branch.emitted, true);
    }
    let glossy = inputs.scene.features.glossy;
    // The Lambertian BRDF is albedo / π.
    let brdf = if glossy { DVec3::ONE } else { reflector.diffuse / PI };
    let point = VisiblePoint {
        position_object: with_word(surface.position, surface.object),
        weight_normal: with_word(branch.throughput * brdf, encode_direction(facing.geometric_normal)),
        emitted_normal: with_word(branch.emitted, encode_direction(facing.shading_normal)),
    };
    Slot {
        point,
        gloss: reflector.to_gloss(-branch.ray.direction, has_coat(inputs, surface)),
        footprint: 0.0,
    }
}

fn follow(inputs: &Inputs<'_>, pixel: [u32; 2], turn: CameraTurn, slots: &mut [Slot], counts: &Counts) {
    let settings = inputs.settings;
    let [width, _] = settings.resolution;
    let mut random = Random::of_pixel(inputs.config, PathKind::Camera, pixel[1] * width + pixel[0], turn);
    let [jitter_x, jitter_y, ..] = random.next4();
    let [x, y] = match inputs.config.estimator {
        Estimator::Sppm => [jitter_x, jitter_y],
        Estimator::Ppm => [0.5; 2],
    };
    // −1 to 1 from left to right and from top to bottom.
    let film = |pixel: u32, inside: f64, side: u32| (f64::from(pixel) + inside) / f64::from(side) * 2.0 - 1.0;
    let (right, up) = (xyz(settings.camera_right), xyz(settings.camera_up));
    let place = film(pixel[0], x, settings.resolution[0]) * right - film(pixel[1], y, settings.resolution[1]) * up;
    let [.., lens_radius] = settings.camera_position;
    let [.., focus] = settings.camera_right;
    let [.., parallel] = settings.camera_up;
    let (mut origin, mut direction) = (xyz(settings.camera_position), xyz(settings.camera_forward));
    *(if parallel != 0.0 { &mut origin } else { &mut direction }) += place;
    if lens_radius > 0.0 {
        // All rays of a place in the picture meet where it is in focus.
        let [lens_u, lens_v, ..] = random.next4();
        let on_lens = f64::from(lens_radius) * disc_point(lens_u, lens_v);
        let off_axis = on_lens.x * right.normalize() + on_lens.y * up.normalize();
        origin += off_axis;
        direction = f64::from(focus) * direction - off_axis;
    }

    let mut pending = vec![Branch {
        ray: Ray {
            origin,
            direction: direction.normalize(),
        },
        throughput: DVec3::ONE,
        emitted: DVec3::ZERO,
        way: 0.0,
        depth: 0,
        ignored: None,
        media: Media::of(settings.camera_media),
        wavelength: None,
        reflection_seen: false,
        emission_seen: false,
        lamps_seen: false,
    }];
    let mut used = 0;
    let mut met_surface = false;
    while let Some(mut branch) = pending.pop() {
        let slot = loop {
            let culls = branch.depth == 0;
            let hit = nearest_seen(inputs, branch.ray, FAR, branch.ignored, culls, &random);
            if !branch.lamps_seen && !branch.emission_seen {
                let end = hit.map_or(FAR, |hit| hit.t);
                branch.emitted += branch.throughput * soft_lights_along(inputs, branch.ray, end, branch.media);
            }
            let Some(hit) = hit else {
                if !branch.emission_seen {
                    let sky = Environment::of(&inputs.scene.environment).at(branch.ray.direction);
                    branch.emitted += branch.throughput * sky.radiance;
                }
                break nothing_seen(branch.emitted, met_surface);
            };
            let incoming = branch.ray.direction;
            let met = Encounter::new(inputs, hit, incoming, branch.media, culls, &random);
            let (surface, mut facing) = (met.surface, met.facing);
            branch.way += hit.t;
            branch.throughput *= transmittance(inputs, met.through, hit.t);
            if met.hidden {
                branch.throughput *= met.tint;
                branch.media = met.beyond;
                (branch.emission_seen, branch.lamps_seen) = (false, false);
                branch.ray.origin = surface.origin_towards(incoming);
                branch.ignored = Some(surface.triangle);
                continue;
            }
            met_surface = true;
            let base_color = rgb(surface.material.base_color);
            if emits(&surface.material, facing.front) {
                let emission = emitted_radiance(&surface.material, -incoming.dot(facing.geometric_normal));
                branch.emitted += if branch.emission_seen {
                    DVec3::ZERO
                } else {
                    branch.throughput * emission
                };
            }
            branch.emission_seen = false;
            let mut material = surface.material;
            if is_mixed(&material) {
                choose_part(&mut material, random.next4()[0]);
            }
            if material.coat > 0.0 {
                let [u, ..] = random.next4();
                branch.throughput *= facing.choose_layer(&mut material, surface.coat_normal, incoming, u);
            }
            let kind = material.surface;
            let (is_matte, is_glossy) = (kind == MATTE, kind == GLOSSY_SURFACE);
            // A visible point has the surface's base, and its reflection unless that is so narrow that the path follows it.
            let reflector = if is_glossy {
                Reflector::of_material(&material)
            } else {
                Reflector::matte(base_color)
            };
            if is_matte || (is_glossy && reflector.alpha >= FOLLOWED_ALPHA) {
                break seen(inputs, &branch, &surface, &facing, reflector);
            }
            if branch.depth + 1 >= settings.max_depth {
                counts.add_truncated(1);
                break nothing_seen(branch.emitted, met_surface);
            }
            branch.depth += 1;
            branch.ignored = Some(surface.triangle);
            branch.lamps_seen = false;
            let [choice, second, third, _] = random.next4();
            if is_glossy {
                if inputs.scene.features.punctual && !reflector.is_smooth() {
                    let seen = glint(inputs, &met, &material, &facing, &reflector, incoming, &random);
                    branch.emitted += branch.throughput * seen;
                    branch.lamps_seen = true;
                }
                let p = reflector.reflection_probability(-incoming.dot(facing.shading_normal));
                let (direction, weight) = facing.follow(&reflector, incoming, [second, third]);
                let reflected = Branch {
                    ray: Ray {
                        origin: surface.origin_towards(direction),
                        direction,
                    },
                    throughput: branch.throughput * weight,
                    ..branch
                };
                let stopping = Reflector {
                    alpha: 0.0,
                    ..reflector
                };
                if p > 0.0 && p < 1.0 && used + pending.len() + 1 < slots.len() {
                    pending.push(Branch {
                        emitted: DVec3::ZERO,
                        ..reflected
                    });
                } else if choice < p {
                    branch = reflected;
                    branch.throughput /= p;
                    if branch.throughput.max_element() <= 0.0 {
                        break nothing_seen(branch.emitted, met_surface);
                    }
                    continue;
                } else {
                    branch.throughput /= 1.0 - p;
                }
                break seen(inputs, &branch, &surface, &facing, stopping);
            }
            branch.ray.direction = if kind == MIRROR {
                branch.throughput *= facing.mirror_reflectance(&material, incoming);
                facing.reflect(incoming)
            } else {
                branch.throughput *= disperse(&mut material, &mut branch.wavelength, &mut random);
                if inputs.scene.features.punctual && !Reflector::microfacets_of(&material).is_smooth() {
                    let seen = glint(inputs, &met, &material, &facing, &reflector, incoming, &random);
                    branch.emitted += branch.throughput * seen;
                    branch.lamps_seen = true;
                }
                let boundary = Boundary::new(&facing, incoming, &material, met.outside, [second, third]);
                // Radiance is compressed on its way into the denser medium: Veach, 1997, section 5.2.
                let transmission = met.tint * boundary.eta.powi(2) * boundary.refracted_weight;
                match boundary.refracted {
                    // While a slot is free, both branches are followed, each weighed with its share.
                    Some(refracted) if used + pending.len() + 1 < slots.len() => {
                        pending.push(Branch {
                            ray: Ray {
                                origin: surface.origin_towards(boundary.reflected),
                                direction: boundary.reflected,
                            },
                            throughput: branch.throughput * boundary.reflectance * boundary.reflected_weight,
                            media: met.through,
                            emitted: DVec3::ZERO,
                            ..branch
                        });
                        branch.throughput *= (1.0 - boundary.reflectance) * transmission;
                        branch.media = met.beyond;
                        refracted
                    }
                    Some(refracted) => {
                        let mut refracts = choice >= boundary.reflectance;
                        if !branch.reflection_seen {
                            branch.reflection_seen = true;
                            let ray = Ray {
                                origin: surface.origin_towards(boundary.reflected),
                                direction: boundary.reflected,
                            };
                            let (ignored, lamps_seen) = (Some(surface.triangle), branch.lamps_seen);
                            let (emission, dark) = glimpse(inputs, ray, ignored, met.through, lamps_seen, &random);
                            branch.emitted +=
                                branch.throughput * boundary.reflectance * boundary.reflected_weight * emission;
                            if dark {
                                branch.throughput *= 1.0 - boundary.reflectance;
                                refracts = true;
                            }
                            branch.emission_seen = !refracts;
                        }
                        if refracts {
                            branch.throughput *= transmission;
                            branch.media = met.beyond;
                            refracted
                        } else {
                            branch.throughput *= boundary.reflected_weight;
                            branch.media = met.through;
                            boundary.reflected
                        }
                    }
                    None => {
                        branch.throughput *= boundary.reflected_weight;
                        branch.media = met.through;
                        boundary.reflected
                    }
                }
            };
            if branch.throughput.max_element() <= 0.0 {
                break nothing_seen(branch.emitted, met_surface);
            }
            branch.ray.origin = surface.origin_towards(branch.ray.direction);
        };
        let way = if parallel == 0.0 { branch.way } else { 1.0 };
        slots[used] = Slot {
            footprint: (f64::from(settings.pixel_spread) * way) as f32,
            ..slot
        };
        used += 1;
    }
}
