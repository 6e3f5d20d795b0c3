//! Descriptions of stages: shader, number of invocations, constants. Independent of Vulkan.

use std::borrow::Cow;

/// Every buffer that a shader can name. A block `Photons` in GLSL is the buffer `BufferId::Photons`.
///
/// The last group has no memory: these are formal parameters of stages that serve several buffers; a [`StageDesc`] binds them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum BufferId {
    /// [`crate::layout::Settings`].
    Settings,
    /// [`crate::layout::BvhRecord`]s, the root first.
    Bvh,
    /// [`crate::layout::HavelTriangle`]s in the order of the BVH's leaves.
    HavelTriangles,
    /// [`crate::layout::ShadingTriangle`]s in the same order.
    ShadingTriangles,
    /// [`crate::layout::Instance`]s.
    Instances,
    /// [`crate::layout::Material`]s.
    Materials,
    /// [`crate::layout::Corner`]s, three to a triangle, where the scene is textured.
    Corners,
    /// [`crate::layout::TextureLookup`]s.
    Textures,
    /// Texels of all images, RGBA bytes.
    Texels,
    /// [`crate::layout::Light`]s.
    Lights,
    /// Spheres in which a light is near, centre and squared radius: see `packing/near_lights.rs`.
    NearLights,
    /// [`crate::layout::LightSource`]s.
    LightSources,
    /// The media that each light is in: see `packing/immersion.rs`.
    MediaOfLights,
    /// The environment and its sampling table; see `glsl/lights/environment.glsl`.
    Environment,
    /// The sampling table of aimed photon paths; see [`crate::emission::Table::texels`].
    EmissionTable,
    /// [`crate::layout::PathStart`] of each photon path of a batch.
    PathStarts,
    /// The value of each path of an iteration's first batch, u32; see `glsl/stages/photons.comp`.
    PathValues,
    /// [`crate::layout::VisiblePoint`]s in slot order.
    VisiblePoints,
    /// [`crate::layout::PackedBsdf`] of each slot, where the scene has glossy surfaces.
    PackedBsdfs,
    /// [`crate::layout::Statistics`] of each slot, for each photon map.
    StatisticsOf,
    /// [`crate::layout::Gathered`] of each slot, for each photon map.
    GatheredOf,
    /// [`crate::layout::DirectSum`] of each slot.
    DirectSums,
    /// Radiance (RGB and curvature) that each slot had in the iterations of a sequence, summed up in f32: for their spread.
    Sequence0Sums,
    /// Likewise of the next one.
    Sequence1Sums,
    /// Likewise.
    Sequence2Sums,
    /// Likewise.
    Sequence3Sums,
    /// [`crate::layout::Coverage`] of each slot, for each photon map.
    CoverageOf,
    /// Footprint of each slot's pixel at its visible point, f32.
    Footprints,
    /// R² of each slot in this iteration, f32, for each photon map.
    Radii2,
    /// Demand for photons in each cell, f32; see `glsl/gather/demand.glsl`.
    Demand,
    /// [`crate::layout::ShellRadii`] of each photon map's shells.
    RadiiOfShells,
    /// [`crate::layout::Photon`]s as the lanes store them: number-major, `[number][lane]`.
    LanePhotons,
    /// Photons that each lane stored, u32.
    LaneCounts,
    /// Photons of the lanes before, u32.
    LaneOffsets,
    /// Number of photons of the batch, one u32.
    PhotonCount,
    /// [`crate::layout::Photon`]s in path order within their lane.
    Photons,
    /// [`crate::layout::Photon`]s in the order of their grid cells or meshes.
    SortedPhotons,
    /// [`crate::layout::GridShape`].
    Grid,
    /// First photon of each grid bucket and, past the last one, the number of photons, u32.
    CellStarts,
    /// One past each mesh's last photon, u32.
    MeshEnds,
    /// [`crate::layout::ObjectGrid`] of each object.
    ObjectGrids,
    /// First photon of each cell of the objects' grids and, past the last one, the number of photons, u32.
    ObjectCells,
    /// Number of photons stored in each of those cells, u32.
    ObjectCellCursors,
    /// Slots in the order of the gather's workgroups, u32; [`crate::layout::NO_SLOT`] for fillers.
    PointOrder,
    /// Slots by mesh and along a curve within it, u32; [`crate::layout::NO_SLOT`] for fillers.
    MeshOrder,
    /// Fillers of the meshes before, u32.
    MeshFillers,
    /// Number of slots, one u32.
    PointCount,
    /// Sort keys of visible points, u32.
    PointKeys,
    /// Slots that are sorted by [`BufferId::PointKeys`], u32.
    PointValues,
    /// Sort keys of visible points after every other pass.
    OtherPointKeys,
    /// Slots after every other pass.
    OtherPointValues,
    /// [`crate::layout::Centroid`] of each cluster of visible points.
    Centroids,
    /// Cluster of each place of [`BufferId::MeshOrder`], u32.
    ClusterOf,
    /// Visible points of each cluster, u32.
    ClusterSizes,
    /// First place of each cluster in [`BufferId::PointOrder`], u32.
    ClusterStarts,
    /// Source of the copy that measures memory bandwidth.
    ProbeFrom,
    /// Destination of that copy.
    ProbeTo,
    /// Photons tested for each slot, for each photon map, u32, if they are counted; the highest bit marks slots that were
    /// processed.
    TestsOf,
    /// Sort keys, u32.
    Keys,
    /// Values that are sorted by [`BufferId::Keys`], u32.
    Values,
    /// Sort keys after every other pass.
    OtherKeys,
    /// Values after every other pass.
    OtherValues,
    /// Digit counts of a sort pass, u32, `[digit][tile]`, and behind the last tile the totals.
    Histograms,
    /// Block sums of a prefix sum, u32.
    ScanSums,
    /// Total of a prefix sum, one u32.
    ScanTotal,
    /// RGBA f32 picture, row-major from the top left.
    Film,
    /// [`crate::layout::BehindGlass`] of each pixel, row-major from the top left.
    GlassFilm,
    /// [`crate::layout::LightParts`] of each pixel, if they are wanted, row-major from the top left.
    LightPartsFilm,
    /// [`crate::layout::SurfaceSum`] of each pixel, if layers show surfaces, row-major from the top left.
    SurfaceSums,
    /// [`crate::layout::IdCount`]s of each pixel, likewise: of objects, then of materials.
    IdCounts,
    /// As [`BufferId::Film`], of the iterations of one sequence.
    Sequence0Film,
    /// Likewise of the next one.
    Sequence1Film,
    /// Likewise.
    Sequence2Film,
    /// Likewise.
    Sequence3Film,
    /// [`crate::layout::StatusCounters`].
    Status,

    /// Parameter: the numbers of a prefix sum.
    Scan,
    /// Parameter: one of [`SEQUENCE_SUMS`].
    SequenceSums,
    /// Parameter: one of [`SEQUENCE_FILMS`].
    SequenceFilm,
    /// Parameter: the photons that are gathered.
    GatheredFrom,
    /// Parameter: the order that is written.
    OrderOut,
    /// Parameter: number of keys to sort, one u32.
    SortCount,
    /// Parameter: keys before a sort pass.
    KeysIn,
    /// Parameter: values before a sort pass.
    ValuesIn,
    /// Parameter: keys after a sort pass.
    KeysOut,
    /// Parameter: values after a sort pass.
    ValuesOut,
}

/// Of each sequence.
pub const SEQUENCE_SUMS: [BufferId; 4] = [
    BufferId::Sequence0Sums,
    BufferId::Sequence1Sums,
    BufferId::Sequence2Sums,
    BufferId::Sequence3Sums,
];
/// Of each sequence.
pub const SEQUENCE_FILMS: [BufferId; 4] = [
    BufferId::Sequence0Film,
    BufferId::Sequence1Film,
    BufferId::Sequence2Film,
    BufferId::Sequence3Film,
];

/// How a shader uses a buffer, from the block's qualifiers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// `readonly`.
    Read,
    /// `writeonly`.
    Write,
    /// Neither.
    ReadWrite,
    /// A uniform block.
    Uniform,
    /// A `usamplerBuffer`: 16-byte texels, read only.
    Texels,
}

impl Access {
    /// Whether the shader may write.
    pub fn writes(self) -> bool {
        matches!(self, Self::Write | Self::ReadWrite)
    }
}

/// A member of a struct in GLSL, as reflection gives it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Name in GLSL.
    pub name: &'static str,
    /// Bytes from the struct's beginning.
    pub offset: usize,
    /// Bytes; 0 for an array without a length.
    pub size: usize,
}

/// A struct in GLSL, as reflection gives it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StructLayout {
    /// Name in GLSL.
    pub name: &'static str,
    /// Members in order.
    pub fields: &'static [Field],
}

impl StructLayout {
    /// Bytes up to the last member's end.
    pub fn size(&self) -> usize {
        self.fields
            .iter()
            .map(|field| field.offset + field.size)
            .max()
            .unwrap_or(0)
    }
}

/// A buffer that a shader binds.
#[derive(Debug, Clone, Copy)]
pub struct Binding {
    /// Binding number in descriptor set 0.
    pub slot: u32,
    /// The buffer that its block names.
    pub buffer: BufferId,
    /// How it is used.
    pub access: Access,
    /// The struct that the block is an array of, or the block itself.
    pub element: StructLayout,
}

/// A specialisation constant.
#[derive(Debug, Clone, Copy)]
pub struct SpecConstant {
    /// Its `constant_id`.
    pub id: u32,
    /// Its name in GLSL.
    pub name: &'static str,
}

/// The pseudo-constant that chooses [`Shader::ray_query`]. It can't be a specialisation constant: a device without ray queries
/// can't load a module that contains them.
pub const RAY_QUERY: &str = "RAY_QUERY";

/// A compiled stage, as `build.rs` describes it.
#[derive(Debug)]
pub struct Shader {
    /// The stage's name: its file, its timestamps' key, its debug label, its line in the report.
    pub name: &'static str,
    /// SPIR-V, little endian.
    pub spirv: &'static [u8],
    /// The same with ray queries, if the stage traces rays: see [`RAY_QUERY`].
    pub ray_query: Option<&'static [u8]>,
    /// Invocations of a workgroup.
    pub workgroup: u32,
    /// The buffers that it binds.
    pub bindings: &'static [Binding],
    /// Its push constants, if any.
    pub push_constants: Option<StructLayout>,
    /// Its specialisation constants.
    pub constants: &'static [SpecConstant],
}

impl Shader {
    /// Storage buffers that it binds.
    pub fn storage_buffers(&self) -> usize {
        let storage = |access| matches!(access, Access::Read | Access::Write | Access::ReadWrite);
        self.bindings.iter().filter(|binding| storage(binding.access)).count()
    }
}

/// A block of push constants. `build.rs` generates a struct for each block in GLSL.
pub trait PushConstants: bytemuck::NoUninit {
    /// The block's name in GLSL.
    const NAME: &str;
}

/// A launch of a stage.
#[derive(Debug, Clone)]
pub struct StageDesc {
    /// The shader.
    pub shader: &'static Shader,
    /// Invocations, rounded up to whole workgroups.
    pub threads: u32,
    /// Values of specialisation constants by name; those left out keep the shader's default.
    pub constants: Cow<'static, [(&'static str, u32)]>,
    /// Bytes of the push constants.
    pub push: Vec<u8>,
    /// The buffers bound to formal parameters.
    pub bound: Cow<'static, [(BufferId, BufferId)]>,
}

impl StageDesc {
    /// A launch of `shader` with `threads` invocations.
    pub fn new(shader: &'static Shader, threads: u32) -> Self {
        Self {
            shader,
            threads,
            constants: Cow::Borrowed(&[]),
            push: Vec::new(),
            bound: Cow::Borrowed(&[]),
        }
    }

    /// The module with ray queries, if that is the one to run.
    pub fn ray_query(&self) -> Option<&'static [u8]> {
        let enabled = self
            .constants
            .iter()
            .any(|&(name, value)| name == RAY_QUERY && value != 0);
        self.shader.ray_query.filter(|_| enabled)
    }

    /// With these push constants, the shader's.
    pub fn push<T: PushConstants>(mut self, constants: T) -> Self {
        let expected = self.shader.push_constants.map(|block| block.name);
        assert_eq!(Some(T::NAME), expected, "push constants of {}", self.shader.name);
        self.push = bytemuck::bytes_of(&constants).to_vec();
        self
    }

    /// With these specialisation constants.
    pub fn constants(mut self, constants: impl Into<Cow<'static, [(&'static str, u32)]>>) -> Self {
        self.constants = constants.into();
        self
    }

    /// With one specialisation constant more.
    pub fn constant(mut self, name: &'static str, value: u32) -> Self {
        self.constants.to_mut().push((name, value));
        self
    }

    /// With these buffers for the shader's formal parameters.
    pub fn bind(mut self, bound: impl Into<Cow<'static, [(BufferId, BufferId)]>>) -> Self {
        self.bound = bound.into();
        self
    }

    /// Workgroups.
    pub fn groups(&self) -> u32 {
        self.threads.div_ceil(self.shader.workgroup)
    }

    /// The buffers that the launch uses, parameters replaced.
    pub fn uses(&self) -> impl Iterator<Item = (u32, BufferId, Access)> + '_ {
        self.shader.bindings.iter().map(|binding| {
            let actual = self.bound.iter().find(|(formal, _)| *formal == binding.buffer);
            (
                binding.slot,
                actual.map_or(binding.buffer, |&(_, actual)| actual),
                binding.access,
            )
        })
    }
}
