// SPDX-License-Identifier: Apache-2.0
//! The generated scenes by name, for commands that take any of them.

use anyhow::{Result, ensure};
use oocpt_core::camera::Camera;
use oocpt_core::scene::SceneDb;

use super::leaves::Leaves;
use super::{forest, island, lamps, leaves, woods};

/// A generated scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "camelCase")]
pub enum Generated {
    /// Diffuse blobs on a ground under a dome.
    Forest,
    /// Trees with textures and leaves that are cut out, dome and sun.
    Woods,
    /// Instanced cards with an opaque picture.
    Leaves,
    /// The same, cut out by a picture.
    Cutouts,
    /// The forest by night, a lamp for every ten blobs.
    Lamps,
    /// The island, nesting kept.
    Island,
}

impl Generated {
    /// All, in the order of the documentation.
    pub const ALL: [Self; 6] = [Self::Forest, Self::Woods, Self::Leaves, Self::Cutouts, Self::Lamps, Self::Island];

    /// The name in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Forest => "forest",
            Self::Woods => "woods",
            Self::Leaves => "leaves",
            Self::Cutouts => "cutouts",
            Self::Lamps => "lamps",
            Self::Island => "island",
        }
    }

    /// The scene of that name, if there is one.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|scene| scene.name() == name)
    }

    fn island(scale: u32) -> island::Parameters {
        let instances = 10_000 * u64::from(scale);
        island::Parameters { instances, unique_quads: instances, copies: 1, flatten: false, distinct: false, seed: 7 }
    }

    /// Fills `db` with the scene; numbers of instances grow with `scale`, 1 is small.
    pub fn build(self, db: &mut SceneDb, scale: u32) -> Result<()> {
        ensure!((1..=10_000).contains(&scale), "--scale: 1 to 10 000");
        match self {
            Self::Forest => forest::build(db, 1000 * scale),
            Self::Woods => {
                let trees = woods::Parameters {
                    trees: 12,
                    tree_quads: 1024,
                    cards: 100,
                    texture_size: 128,
                    instances: 300 * scale,
                };
                woods::build(db, &trees)
            }
            Self::Leaves => leaves::build(db, Leaves::Opaque, 1000 * scale, 256),
            Self::Cutouts => leaves::build(db, Leaves::Cut, 1000 * scale, 256),
            Self::Lamps => lamps::build(db, 1000 * scale, 100 * scale),
            Self::Island => island::build(db, &Self::island(scale)).map(drop),
        }
    }

    /// Its camera.
    pub fn camera(self, scale: u32, width: u32, height: u32) -> Camera {
        match self {
            Self::Forest | Self::Lamps => forest::camera(width, height),
            Self::Woods => woods::camera(width, height),
            Self::Leaves | Self::Cutouts => leaves::camera(width, height),
            Self::Island => island::camera(&Self::island(scale), width, height),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_is_built_and_found_by_its_name() {
        for scene in Generated::ALL {
            assert_eq!(Generated::named(scene.name()), Some(scene), "{scene:?}");
            let mut db = SceneDb::new();
            scene.build(&mut db, 1).expect("a small scene");
            let commit = db.commit();
            assert!(commit.warnings.is_empty(), "{scene:?}: {:?}", commit.warnings);
            assert!(commit.snapshot.counts.instances > 100, "{scene:?} has instances");
        }
        assert_eq!(Generated::named("no such scene"), None, "a file");
        assert!(Generated::Forest.build(&mut SceneDb::new(), 0).is_err(), "scale 0");
    }

    #[test]
    fn the_lamps_scene_has_no_other_light() {
        let mut db = SceneDb::new();
        Generated::Lamps.build(&mut db, 1).expect("a small scene");
        assert_eq!(db.commit().snapshot.lights.len(), 100, "no dome");
    }
}
