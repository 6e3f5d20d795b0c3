//! Meshes in closed form, in metres, y up. Front faces are counter-clockwise.

use glam::{DVec2, DVec3, dvec2, dvec3};
use std::collections::HashMap;
use std::f64::consts::TAU;

/// A triangle mesh with a normal for each vertex.
#[derive(Default)]
pub struct Mesh {
    pub positions: Vec<DVec3>,
    /// Unit shading normals.
    pub normals: Vec<DVec3>,
    /// Texture coordinates; may be empty.
    pub texcoords: Vec<DVec2>,
    /// Colours, linear; may be empty.
    pub colors: Vec<DVec3>,
    pub triangles: Vec<[u16; 3]>,
}

impl Mesh {
    fn vertex(&mut self, position: DVec3, normal: DVec3) {
        self.positions.push(position);
        self.normals.push(normal);
    }

    /// Index that the next vertex will have.
    fn next(&self) -> u16 {
        u16::try_from(self.positions.len()).expect("meshes here have fewer than 65,536 vertices")
    }

    /// Adds a flat quad with its own vertices; `corners` counter-clockwise from the texture's lower left.
    fn push_quad(&mut self, corners: [DVec3; 4]) {
        let first = self.next();
        let normal = (corners[1] - corners[0]).cross(corners[3] - corners[0]).normalize();
        for corner in corners {
            self.vertex(corner, normal);
        }
        self.texcoords
            .extend([dvec2(0.0, 1.0), dvec2(1.0, 1.0), dvec2(1.0, 0.0), dvec2(0.0, 0.0)]);
        self.triangles
            .extend([[0, 1, 2], [0, 2, 3]].map(|triangle| triangle.map(|corner| first + corner)));
    }

    /// Adds two triangles for each cell between the rows of `cells + 1` vertices that start at `a` and `b`; the diagonal
    /// runs from `a`'s far vertex to `b`'s near one. Seen from the front, `b` is to the left of the direction along `a`, or to
    /// the right with `flip`.
    fn push_strip(&mut self, a: u16, b: u16, cells: u16, flip: bool) {
        for cell in 0..cells {
            let (a, b) = (a + cell, b + cell);
            for mut triangle in [[a, a + 1, b], [a + 1, b + 1, b]] {
                if flip {
                    triangle.swap(1, 2);
                }
                self.triangles.push(triangle);
            }
        }
    }

    /// A flat quad; `corners` counter-clockwise from the texture's lower left.
    pub fn quad(corners: [DVec3; 4]) -> Self {
        let mut mesh = Self::default();
        mesh.push_quad(corners);
        mesh
    }

    /// A horizontal square around the y axis at height `y`, facing up.
    pub fn facing_up(half_side: f64, y: f64) -> Self {
        let h = half_side;
        Self::quad([dvec3(-h, y, h), dvec3(h, y, h), dvec3(h, y, -h), dvec3(-h, y, -h)])
    }

    /// A horizontal square around the y axis at height `y`, facing down.
    pub fn facing_down(half_side: f64, y: f64) -> Self {
        let h = half_side;
        Self::quad([dvec3(-h, y, -h), dvec3(h, y, -h), dvec3(h, y, h), dvec3(-h, y, h)])
    }

    /// A square around `centre` with horizontal upper and lower edges, facing `target`.
    pub fn facing(centre: DVec3, target: DVec3, half_side: f64) -> Self {
        let normal = (target - centre).normalize();
        let right = DVec3::Y.cross(normal).normalize();
        let up = normal.cross(right);
        let corner = |x: f64, y: f64| centre + right * (x * half_side) + up * (y * half_side);
        Self::quad([
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ])
    }

    /// An axis-aligned box, facing outward, with four vertices a side.
    pub fn cuboid(min: DVec3, max: DVec3) -> Self {
        let corner = |x: usize, y: usize, z: usize| {
            let ends = [min, max];
            dvec3(ends[x].x, ends[y].y, ends[z].z)
        };
        let mut mesh = Self::default();
        for side in [
            [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
            [(1, 0, 0), (0, 0, 0), (0, 1, 0), (1, 1, 0)],
            [(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)],
            [(1, 0, 1), (1, 0, 0), (1, 1, 0), (1, 1, 1)],
            [(0, 1, 1), (1, 1, 1), (1, 1, 0), (0, 1, 0)],
            [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)],
        ] {
            mesh.push_quad(side.map(|(x, y, z)| corner(x, y, z)));
        }
        mesh
    }

    /// A sphere around the origin: an icosahedron whose triangles are split into four `levels` times.
    pub fn icosphere(radius: f64, levels: u32) -> Self {
        let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
        let mut points = Vec::new();
        // The corners of three golden rectangles, in the planes z = 0, x = 0 and y = 0.
        for turn in [
            |s, t| dvec3(s, t, 0.0),
            |s, t| dvec3(0.0, s, t),
            |s, t| dvec3(t, 0.0, s),
        ] as [fn(f64, f64) -> DVec3; 3]
        {
            for (s, t) in [(-1.0, golden), (1.0, golden), (-1.0, -golden), (1.0, -golden)] {
                points.push(turn(s, t).normalize());
            }
        }
        let mut triangles: Vec<[u16; 3]> = vec![
            [0, 11, 5],
            [0, 5, 1],
            [0, 1, 7],
            [0, 7, 10],
            [0, 10, 11],
            [1, 5, 9],
            [5, 11, 4],
            [11, 10, 2],
            [10, 7, 6],
            [7, 1, 8],
            [3, 9, 4],
            [3, 4, 2],
            [3, 2, 6],
            [3, 6, 8],
            [3, 8, 9],
            [4, 9, 5],
            [2, 4, 11],
            [6, 2, 10],
            [8, 6, 7],
            [9, 8, 1],
        ];
        for _ in 0..levels {
            let mut midpoints = HashMap::new();
            let mut midpoint = |a: u16, b: u16| {
                *midpoints.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    points.push((points[usize::from(a)] + points[usize::from(b)]).normalize());
                    u16::try_from(points.len() - 1).expect("fewer than 65,536 vertices")
                })
            };
            triangles = triangles
                .into_iter()
                .flat_map(|[a, b, c]| {
                    let [ab, bc, ca] = [midpoint(a, b), midpoint(b, c), midpoint(c, a)];
                    [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
                })
                .collect();
        }
        Self {
            positions: points.iter().map(|&point| point * radius).collect(),
            normals: points,
            texcoords: Vec::new(),
            colors: Vec::new(),
            triangles,
        }
    }

    /// The wall of a column around the y axis, seen from outside; the texture is repeated `times` around it.
    pub fn column(radius: f64, height: f64, segments: u16, times: f64) -> Self {
        let mut mesh = Self::default();
        for y in [0.0, height] {
            for step in 0..=segments {
                let part = f64::from(step) / f64::from(segments);
                let (sin, cos) = (TAU * part).sin_cos();
                let normal = dvec3(sin, 0.0, cos);
                mesh.vertex(radius * normal + y * DVec3::Y, normal);
                mesh.texcoords.push(dvec2(times * part, 1.0 - y / height));
            }
        }
        mesh.push_strip(0, segments + 1, segments, false);
        mesh
    }

    /// A horizontal square that faces up, of `cells` × `cells` cells, with vertex colours by x and z.
    pub fn colored(half_side: f64, cells: u16, color: impl Fn(f64, f64) -> DVec3) -> Self {
        let along = |step: u16| -half_side + 2.0 * half_side * f64::from(step) / f64::from(cells);
        let row = cells + 1;
        let mut mesh = Self::default();
        for (z, x) in (0..row).flat_map(|z| (0..row).map(move |x| (along(z), along(x)))) {
            mesh.vertex(dvec3(x, 0.0, z), DVec3::Y);
            mesh.colors.push(color(x, z));
        }
        for z in 0..cells {
            mesh.push_strip(z * row, (z + 1) * row, cells, true);
        }
        mesh
    }

    /// A ring around the y axis with a rectangular section from `inner` to `outer` radius and `bottom` to `top`.
    pub fn ring(inner: f64, outer: f64, bottom: f64, top: f64, segments: u16) -> Self {
        let mut mesh = Self::default();
        // Each side: two circles (radius, height), the normal (radial, vertical), and `flip` of its strip.
        for (circles, (radial, vertical), flip) in [
            ([(outer, bottom), (outer, top)], (1.0, 0.0), true),
            ([(inner, bottom), (inner, top)], (-1.0, 0.0), false),
            ([(inner, top), (outer, top)], (0.0, 1.0), false),
            ([(inner, bottom), (outer, bottom)], (0.0, -1.0), true),
        ] {
            let first = mesh.next();
            for (radius, y) in circles {
                for step in 0..=segments {
                    let angle = TAU * f64::from(step) / f64::from(segments);
                    let direction = dvec3(angle.cos(), 0.0, angle.sin());
                    mesh.vertex(
                        direction * radius + DVec3::Y * y,
                        direction * radial + DVec3::Y * vertical,
                    );
                }
            }
            mesh.push_strip(first, first + segments + 1, segments, flip);
        }
        mesh
    }

    /// A closed body over the square of `half_side` around the y axis, from the flat `bottom` up to the surface
    /// y = `height`(x, z), which is given with its derivatives in x and z, in `cells` × `cells` steps.
    pub fn body_of_liquid(half_side: f64, bottom: f64, cells: u16, height: impl Fn(f64, f64) -> [f64; 3]) -> Self {
        let along = |step: u16| -half_side + 2.0 * half_side * f64::from(step) / f64::from(cells);
        let row = cells + 1;
        let mut mesh = Self::default();
        for (z, x) in (0..row).flat_map(|z| (0..row).map(move |x| (along(z), along(x)))) {
            let [y, slope_x, slope_z] = height(x, z);
            mesh.vertex(dvec3(x, y, z), dvec3(-slope_x, 1.0, -slope_z).normalize());
        }
        for z in 0..cells {
            mesh.push_strip(z * row, (z + 1) * row, cells, true);
        }

        // The sides, each along one edge of the surface: its first vertex, and the step to the next. They form a loop.
        let (last, stride) = (i32::from(cells), i32::from(row));
        let edges = [
            (0, 1, DVec3::NEG_Z),
            (last, stride, DVec3::X),
            (stride * stride - 1, -1, DVec3::Z),
            (last * stride, -stride, DVec3::NEG_X),
        ];
        let mut rim = Vec::new();
        for (start, step, normal) in edges {
            let top: Vec<DVec3> = (0..=last)
                .map(|count| mesh.positions[(start + step * count) as usize])
                .collect();
            let floor: Vec<DVec3> = top.iter().map(|point| point.with_y(bottom)).collect();
            let first = mesh.next();
            for &position in top.iter().chain(&floor) {
                mesh.vertex(position, normal);
            }
            mesh.push_strip(first, first + row, cells, false);
            rim.extend_from_slice(&floor[..usize::from(cells)]);
        }

        // The bottom, a fan around its centre.
        let first = mesh.next();
        let centre = first + 4 * cells;
        for &position in &rim {
            mesh.vertex(position, DVec3::NEG_Y);
        }
        mesh.vertex(dvec3(0.0, bottom, 0.0), DVec3::NEG_Y);
        for step in 0..4 * cells {
            let after = (step + 1) % (4 * cells);
            mesh.triangles.push([first + step, first + after, centre]);
        }
        mesh
    }

    /// The same surface, facing the other side.
    pub fn flipped(mut self) -> Self {
        for normal in &mut self.normals {
            *normal = -*normal;
        }
        for triangle in &mut self.triangles {
            triangle.reverse();
        }
        self
    }

    /// The texture repeated `times` along each axis.
    pub fn tiled(mut self, times: f64) -> Self {
        for texcoord in &mut self.texcoords {
            *texcoord *= times;
        }
        self
    }
}
