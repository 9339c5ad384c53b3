// SPDX-License-Identifier: Apache-2.0
//! The boundary between the Hydra shim (C++) and the renderer (Rust); `ffi_images` and `ffi_runner` hold their own
//! parts.
//!
//! Guarantees: no panic leaves it (every function goes through `guard` and returns `Result`, a `rust::Error` in C++);
//! arrays are read where USD holds them, never copied; matrices are Gf's row-vector data, read as columns.
//!
//! Threads: `Session` may be used from any thread. C++ owns the objects; Rust owns every `HeldArray` it was given.
#![deny(unsafe_code)]

mod convert;
mod edits;
mod ffi_images;
mod ffi_runner;
mod guard;
#[allow(unsafe_code, reason = "Send and Sync of the C++ types are promised here")]
mod held;
mod host_file;
mod images;
mod light;
mod logging;
mod material;
mod runner;
mod session;
mod settings;
mod stats;
mod texture_file;

use session::{Session, close_session, naming_primvars, open_session, ray_primvar_names, setting_descriptors};
use texture_file::texture_file;

/// Declarations that cxx turns into both sides of the boundary.
#[allow(
    unsafe_code,
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    unused_qualifications,
    clippy::multiple_unsafe_ops_per_block,
    clippy::undocumented_unsafe_blocks,
    clippy::use_self,
    reason = "cxx expands this module into extern blocks and shims"
)]
#[cxx::bridge(namespace = "oocpt")]
mod ffi {
    /// Element type of an array.
    #[repr(u8)]
    #[derive(Debug)]
    enum ElementTag {
        Bool,
        I32,
        F16,
        F32,
        F64,
        Vec2h,
        Vec2f,
        Vec2d,
        Vec3h,
        Vec3f,
        Vec3d,
        Vec4h,
        Vec4f,
        Vec4d,
        Quath,
        Quatf,
        Quatd,
        Matrix4f,
        Matrix4d,
    }

    /// `HdInterpolation`.
    #[repr(u8)]
    #[derive(Debug)]
    enum InterpolationTag {
        Constant,
        Uniform,
        Varying,
        Vertex,
        FaceVarying,
        Instance,
    }

    /// Kinds of light.
    #[repr(u8)]
    #[derive(Debug)]
    enum LightTag {
        Dome,
        Distant,
        Rect,
        Sphere,
        Disk,
        Cylinder,
        GlowTintedMesh,
        IndependentMesh,
        LightOnlyMesh,
    }

    /// The type of a [`ParamDesc`]'s value.
    #[repr(u8)]
    #[derive(Debug)]
    enum ParamTag {
        Bool,
        Int,
        Float,
        Vec2,
        Vec3,
        Vec4,
        Text,
        Asset,
    }

    /// The type of a [`ScalarValue`].
    #[repr(u8)]
    #[derive(Debug)]
    enum ScalarTag {
        Bool,
        Int,
        Float,
        Text,
    }

    /// The severity of a message.
    #[repr(u8)]
    #[derive(Debug)]
    enum MessageSeverity {
        Status,
        Warning,
        Error,
    }

    /// The outcome of setting a value.
    #[repr(u8)]
    #[derive(Debug)]
    enum SettingOutcome {
        Unchanged,
        Changed,
        Unknown,
    }

    /// One value of a setting or a statistic; only the member named by `tag` counts.
    #[derive(Debug, Clone)]
    struct ScalarValue {
        tag: ScalarTag,
        flag: bool,
        integer: i64,
        real: f64,
        text: String,
    }

    /// A value with its name.
    #[derive(Debug, Clone)]
    struct NamedValue {
        key: String,
        value: ScalarValue,
    }

    /// One entry of the settings list that hosts show.
    #[derive(Debug, Clone)]
    struct SettingDescriptor {
        key: String,
        name: String,
        default_value: ScalarValue,
    }

    /// One line for the user.
    #[derive(Debug, Clone)]
    struct UserMessage {
        severity: MessageSeverity,
        text: String,
    }

    /// A primvar; absent when `values` is null.
    struct PrimvarDesc {
        interpolation: InterpolationTag,
        values: UniquePtr<HeldArray>,
        indices: UniquePtr<HeldArray>,
    }

    /// A primvar and its name without `primvars:`.
    struct NamedPrimvarDesc {
        name: String,
        primvar: PrimvarDesc,
    }

    /// A file: its authored path, and the path that the host's resolver found (empty if it found none). Both are empty
    /// if there is no file.
    struct AssetDesc {
        authored: String,
        resolved: String,
    }

    /// The instancer that places a prim, and the prototype that it belongs to.
    struct InstancedByDesc {
        instancer: String,
        prototype_root: String,
    }

    /// The data that every prim has. `transform` is `GfMatrix4d` data as it lies in memory; `motion` has 17 numbers for
    /// each sample: the fraction of the shutter interval, which opens at 0 and closes at 1, and the transform.
    struct PrimDesc {
        path: String,
        transform: [f64; 16],
        motion: Vec<f64>,
        visible: bool,
        purpose: String,
        instanced_by: Vec<InstancedByDesc>,
    }

    /// Faces of a mesh with a material of their own; no material if the path is empty.
    struct SubsetDesc {
        path: String,
        material: String,
        faces: UniquePtr<HeldArray>,
    }

    /// A subdivision surface: scheme and rules are indices of the core's variants. Null arrays are absent.
    struct SubdivisionDesc {
        scheme: u8,
        refine_level: u8,
        boundary: u8,
        face_varying: u8,
        smooth_triangles: bool,
        crease_indices: UniquePtr<HeldArray>,
        crease_lengths: UniquePtr<HeldArray>,
        crease_sharpnesses: UniquePtr<HeldArray>,
        corner_indices: UniquePtr<HeldArray>,
        corner_sharpnesses: UniquePtr<HeldArray>,
    }

    /// `kind` is 0 for a mesh, 1 for curves, 2 for points, 3 for a `solid` (convert/solid.rs); the other members are
    /// indices of the core's variants.
    struct ShapeDesc {
        kind: u8,
        basis: u8,
        wrap: u8,
        counts: UniquePtr<HeldArray>,
        indices: UniquePtr<HeldArray>,
        solid: Vec<f64>,
    }

    /// A mesh; null arrays are absent, and so is the material if its path is empty.
    struct MeshDesc {
        prim: PrimDesc,
        prim_id: i32,
        double_sided: bool,
        left_handed: bool,
        subdivision: SubdivisionDesc,
        face_vertex_counts: UniquePtr<HeldArray>,
        face_vertex_indices: UniquePtr<HeldArray>,
        hole_indices: UniquePtr<HeldArray>,
        points: UniquePtr<HeldArray>,
        point_motion: MotionDesc,
        shape: ShapeDesc,
        widths: PrimvarDesc,
        normals: PrimvarDesc,
        display_color: PrimvarDesc,
        display_opacity: PrimvarDesc,
        primvars: Vec<NamedPrimvarDesc>,
        material: String,
        subsets: Vec<SubsetDesc>,
        categories: Vec<String>,
        label: String,
        /// Primvars that say which rays see the prim.
        ray_primvars: Vec<RayPrimvarDesc>,
        /// What the render pass adds to that: camera rays pass; a matte.
        pass_hides: bool,
        pass_is_matte: bool,
    }

    /// A primvar that says which rays see a prim, without `primvars:`, and its value as text.
    struct RayPrimvarDesc {
        name: String,
        value: String,
    }

    /// One prototype of an instancer and the instances that use it.
    struct PrototypeDesc {
        root: String,
        indices: UniquePtr<HeldArray>,
    }

    /// Arrays at a fraction of the shutter interval: of an instancer, whose positions are translations, or of points.
    struct MotionSampleDesc {
        time: f64,
        positions: UniquePtr<HeldArray>,
        normals: UniquePtr<HeldArray>,
        widths: UniquePtr<HeldArray>,
        rotations: UniquePtr<HeldArray>,
        scales: UniquePtr<HeldArray>,
        transforms: UniquePtr<HeldArray>,
    }

    /// The motion of instances or points; `seconds`: the times at which the shutter opens and closes.
    struct MotionDesc {
        samples: Vec<MotionSampleDesc>,
        velocities: UniquePtr<HeldArray>,
        accelerations: UniquePtr<HeldArray>,
        angular_velocities: UniquePtr<HeldArray>,
        seconds: [f64; 2],
    }

    /// A point instancer or the instancer of native instances; null arrays are absent. `link_names` are categories, set
    /// by set of `link_sizes`; `links` has the number of the set of each instance, or is empty if all have the first.
    struct InstancerDesc {
        prim: PrimDesc,
        prototypes: Vec<PrototypeDesc>,
        mask: UniquePtr<HeldArray>,
        translations: UniquePtr<HeldArray>,
        rotations: UniquePtr<HeldArray>,
        scales: UniquePtr<HeldArray>,
        transforms: UniquePtr<HeldArray>,
        motion: MotionDesc,
        primvars: Vec<NamedPrimvarDesc>,
        link_names: Vec<String>,
        link_sizes: Vec<u32>,
        links: Vec<u32>,
    }

    /// An authored input of a node: numbers in `numbers`, asset paths in `asset`, other text in `text`, also
    /// `colorSpace:name`.
    struct ParamDesc {
        name: String,
        tag: ParamTag,
        flag: bool,
        integer: i64,
        numbers: [f32; 4],
        text: String,
        asset: AssetDesc,
    }

    /// A connection to `input` of the node that holds it from `output` of the node of that number.
    struct ConnectionDesc {
        input: String,
        node: u32,
        output: String,
    }

    /// A shading node.
    struct NodeDesc {
        path: String,
        kind: String,
        params: Vec<ParamDesc>,
        connections: Vec<ConnectionDesc>,
    }

    /// A material; `surface` and `displacement` are the numbers of the nodes at its terminals, or -1.
    struct MaterialDesc {
        path: String,
        nodes: Vec<NodeDesc>,
        surface: i32,
        displacement: i32,
    }

    /// `UsdLuxShapingAPI`.
    struct ShapingDesc {
        cone_angle_degrees: f32,
        cone_softness: f32,
        focus: f32,
        focus_tint: [f32; 3],
        ies: AssetDesc,
        ies_angle_scale: f32,
        ies_normalize: bool,
    }

    /// A light in `UsdLux` terms. Members that its kind does not use are zero or empty; links are categories, or empty.
    struct LightDesc {
        prim: PrimDesc,
        kind: LightTag,
        angle_degrees: f32,
        width: f32,
        height: f32,
        radius: f32,
        length: f32,
        treat_as_point: bool,
        treat_as_line: bool,
        texture: AssetDesc,
        format: String,
        diffuse: f32,
        specular: f32,
        has_shaping: bool,
        shaping: ShapingDesc,
        shadow_enable: bool,
        shadow_color: [f32; 3],
        shadow_reach: [f32; 3],
        light_link: String,
        shadow_link: String,
        label: String,
        color: [f32; 3],
        intensity: f32,
        exposure: f32,
        enable_color_temperature: bool,
        color_temperature: f32,
        normalize: bool,
        camera_visible: bool,
    }

    /// A batch of edits. Removals (each prim with all below it) come first, then the rest in any order.
    struct SceneEdits {
        removed: Vec<String>,
        meshes: Vec<MeshDesc>,
        instancers: Vec<InstancerDesc>,
        lights: Vec<LightDesc>,
        materials: Vec<MaterialDesc>,
    }

    /// One image wanted.
    struct AovDesc {
        name: String,
        has_clear: bool,
        clear: [f32; 4],
    }

    /// A request to render. Windows are x0, y0, x1, y1 in pixels of the images with y down, maxima exclusive. The
    /// projection's [-1, 1] square lands on the display window; the data window is what is rendered.
    struct RenderDesc {
        width: u32,
        height: u32,
        world_from_view: [f64; 16],
        camera_motion: Vec<f64>,
        clip_planes: Vec<f64>,
        projection: [f64; 16],
        display_window: [f32; 4],
        data_window: [i32; 4],
        lens_radius: f64,
        focus_distance: f64,
        exposure_scale: f32,
        aovs: Vec<AovDesc>,
        purposes: Vec<String>,
    }

    /// A render var of a product; settings are namespaced ones.
    struct ProductVarDesc {
        path: String,
        data_type: String,
        source_name: String,
        source_type: String,
        settings: Vec<NamedValue>,
    }

    /// The texts that a prim has in a primvar, or an instancer by the number of an instance.
    struct PrimTextsDesc {
        path: String,
        texts: Vec<String>,
    }

    /// A primvar whose texts name what Cryptomatte layers show.
    struct NamingPrimvarDesc {
        name: String,
        prims: Vec<PrimTextsDesc>,
    }

    /// A render product. `picture` is the picture that it is written of, without images; not if `is_of_host`: then it
    /// is written of the host's. `data_corner`: where the picture's pixels begin in one of `display_size`, y down.
    /// `missing`: why there is no picture; then all but path and name is empty. `time_codes_per_second`: 0 if unknown.
    /// `shutter`: time codes from the frame to its opening and closing.
    struct ProductDesc {
        path: String,
        kind: String,
        name: String,
        vars: Vec<ProductVarDesc>,
        missing: String,
        settings: Vec<NamedValue>,
        color_space: String,
        pixel_aspect: f32,
        display_size: [u32; 2],
        data_corner: [i32; 2],
        has_frame: bool,
        frame: f64,
        time_codes_per_second: f64,
        shutter: [f64; 2],
        is_of_host: bool,
        picture: RenderDesc,
    }

    unsafe extern "C++" {
        include!("bridge/heldArray.h");

        type HeldArray;

        fn bytes(self: &HeldArray) -> &[u8];
        fn element(self: &HeldArray) -> ElementTag;

        /// A held array that owns a copy of `bytes`.
        #[allow(dead_code, reason = "the tests make their arrays with it")]
        fn copy_array(element: ElementTag, bytes: &[u8]) -> UniquePtr<HeldArray>;

        include!("bridge/heldImage.h");
        type ImageSource = crate::ffi_images::ImageSource;
    }

    extern "Rust" {
        type Session;
        fn open_session(images: UniquePtr<ImageSource>) -> Result<Box<Session>>;
        fn close_session(session: Box<Session>) -> Result<()>;
        fn setting_descriptors() -> Result<Vec<SettingDescriptor>>;
        fn ray_primvar_names() -> Result<Vec<String>>;
        fn texture_file(images: UniquePtr<ImageSource>, command: &str, resolved: &str, space: &str) -> Result<String>;
        fn apply_edits(self: &Session, edits: SceneEdits) -> Result<()>;
        fn clear_scene(self: &Session) -> Result<()>;
        fn set_setting(self: &Session, key: &str, value: &ScalarValue) -> Result<SettingOutcome>;
        fn clear_setting(self: &Session, key: &str) -> Result<SettingOutcome>;
        fn render(self: &Session, request: RenderDesc, products: Vec<ProductDesc>) -> Result<()>;
        fn writes_products(self: &Session) -> Result<bool>;
        fn naming_primvars(products: &Vec<ProductDesc>) -> Result<Vec<String>>;
        fn set_naming_primvars(self: &Session, primvars: Vec<NamingPrimvarDesc>) -> Result<()>;
        fn is_converged(self: &Session) -> Result<bool>;
        fn pause(self: &Session) -> Result<()>;
        fn resume(self: &Session) -> Result<()>;
        fn is_paused(self: &Session) -> Result<bool>;
        fn stop(self: &Session, blocking: bool) -> Result<()>;
        fn is_stopped(self: &Session) -> Result<bool>;
        fn restart(self: &Session) -> Result<()>;
        fn read_aov(self: &Session, name: &str, known: u64, destination: &mut [u8]) -> Result<u64>;
        fn stats(self: &Session) -> Result<Vec<NamedValue>>;
        fn take_messages(self: &Session) -> Result<Vec<UserMessage>>;
    }
}
