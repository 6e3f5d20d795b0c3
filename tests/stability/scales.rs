//! Objects of very different size in one scene: rays leave a surface without hitting it again, and without missing a nearby
//! object.

use glam::Vec3;

use super::model::Model;
use super::uniform::{add_ball, add_ball_in_room, assert_lit_by_photons, assert_lit_by_shadow_rays};

/// Half the side of the wall.
const WALL: f32 = 1e4;
/// Radius of the ball beside it.
const BALL: f32 = 1e-4;

/// A room around the ball, next to the wall and 10⁸ times smaller. Light that leaks in or out is visible: the wall emits a
/// thousand times more, or nothing.
fn room_beside_a_wall(wall_radiance: f32) -> Model {
    let mut model = Model::new();
    let wall = model.black(wall_radiance);
    model.quad(
        wall,
        Vec3::new(-WALL, -WALL, -4.0 * BALL),
        Vec3::X * (2.0 * WALL),
        Vec3::Y * (2.0 * WALL),
    );
    add_ball_in_room(&mut model, Vec3::ZERO, 3.0 * BALL, 1.0);
    model
}

#[test]
fn no_light_leaks_out_of_or_into_a_room_a_hundred_million_times_smaller_than_the_wall_beside_it() {
    assert_lit_by_shadow_rays("ball beside a bright wall", &room_beside_a_wall(1e3).scene(), 0, 1.0);
    let scene = room_beside_a_wall(0.0).scene();
    assert_lit_by_shadow_rays("ball beside a dark wall", &scene, 0, 1.0);
    assert_lit_by_photons("ball beside a dark wall", &scene, &[1.0]);
}

#[test]
fn a_ball_a_hundred_million_times_smaller_than_the_room_has_no_acne() {
    let mut model = Model::new();
    let walls = model.black(1.0);
    model.room(walls, Vec3::splat(-WALL), Vec3::splat(WALL));
    add_ball(&mut model, Vec3::ZERO, BALL);
    assert_lit_by_shadow_rays("ball in the middle of a room", &model.scene(), 0, 1.0);
}

/// Away from the middle positions are less precise: 6e-8 of the distance.
#[test]
fn small_balls_in_the_corner_of_a_room_have_no_acne() {
    for radius in [0.1, 1e-2, 1e-3, 1e-4] {
        let mut model = Model::new();
        let walls = model.black(1.0);
        model.room(walls, Vec3::splat(-1.0), Vec3::splat(1.0));
        add_ball(&mut model, Vec3::new(0.6, -0.7, 0.55), radius);
        assert_lit_by_shadow_rays(&format!("ball of {radius} in a corner"), &model.scene(), 0, 1.0);
    }
}
