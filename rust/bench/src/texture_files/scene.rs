// SPDX-License-Identifier: Apache-2.0
//! The scene of a row: quads side by side that fill the frame, each a square of texture space with one texel file,
//! under a dome. One file is one quad; UDIM members lie as their numbers say, at most ten in a row.

/// Number of the first member.
pub(super) const FIRST_MEMBER: u32 = 1001;
/// Members in a row of texture space.
const MAX_COLUMNS: u32 = 10;
/// Most members: the numbers that hosts look for end at 1100.
pub(super) const MAX_MEMBERS: u32 = 100;

/// Columns of so many members, about as many as rows.
fn columns(members: u32) -> u32 {
    (1..MAX_COLUMNS).find(|columns| columns * columns >= members).unwrap_or(MAX_COLUMNS)
}

/// The numbers of so many members.
pub(super) fn numbers(members: u32) -> Vec<u32> {
    let columns = columns(members);
    (0..members).map(|i| FIRST_MEMBER + i % columns + MAX_COLUMNS * (i / columns)).collect()
}

/// The scene as USD text. `file` is an asset path, with `<UDIM>` where there are several members.
pub(super) fn usda(file: &str, members: u32) -> String {
    let columns = columns(members);
    let rows = members.div_ceil(columns);
    let corners = |i: u32| {
        let (x, y) = (i % columns, i / columns);
        [[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]]
    };
    let points: String = (0..members).flat_map(corners).map(|[x, y]| format!("({x}, {y}, 0), ")).collect();
    let st: String = (0..members).flat_map(corners).map(|[x, y]| format!("({x}, {y}), ")).collect();
    let indices: String = (0..4 * members).map(|i| format!("{i}, ")).collect();
    // The frame is exactly the quads: apertures and distances are in the same ratio.
    let (width, height) = (f64::from(columns), f64::from(rows));
    let values = [
        ("VERTICAL", (20.0 * height / width).to_string()),
        ("PLACE", format!("({}, {}, {})", 0.5 * width, 0.5 * height, 2.5 * width)),
        ("COUNTS", "4, ".repeat(members as usize)),
        ("INDICES", indices),
        ("POINTS", points),
        ("COORDINATES", st),
        ("FILE", file.replace('@', "")),
    ];
    values.iter().fold(SCENE.to_owned(), |text, (name, value)| text.replace(&format!("${name}"), value))
}

const SCENE: &str = r#"#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
def Xform "World"
{
    def Camera "Camera"
    {
        float focalLength = 50
        float horizontalAperture = 20
        float verticalAperture = $VERTICAL
        float2 clippingRange = (0.1, 1000)
        double3 xformOp:translate = $PLACE
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DomeLight "Sky"
    {
        float inputs:intensity = 1
    }
    def Mesh "Quads" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [$COUNTS]
        int[] faceVertexIndices = [$INDICES]
        point3f[] points = [$POINTS]
        texCoord2f[] primvars:st = [$COORDINATES] (
            interpolation = "vertex"
        )
        rel material:binding = </World/Paint>
    }
    def Material "Paint"
    {
        token outputs:surface.connect = </World/Paint/Surface.outputs:surface>
        def Shader "Surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </World/Paint/Texture.outputs:rgb>
            float inputs:roughness = 1
            token outputs:surface
        }
        def Shader "Texture"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @$FILE@
            float2 inputs:st.connect = </World/Paint/Coordinates.outputs:result>
            token inputs:wrapS = "clamp"
            token inputs:wrapT = "clamp"
            float3 outputs:rgb
        }
        def Shader "Coordinates"
        {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }
    }
}
"#;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn udim_tiles_are_placed_by_their_numbers() {
        assert_eq!(numbers(1), [1001], "one file");
        assert_eq!(numbers(5), [1001, 1002, 1003, 1011, 1012], "three columns");
        let forty = numbers(40);
        assert_eq!((forty.len(), forty[39]), (40, 1055), "seven columns: 39 = 5 * 7 + 4");
        assert_eq!(numbers(MAX_MEMBERS).last(), Some(&1100), "the last there is");
    }

    #[test]
    fn each_member_has_a_quad_in_its_place() {
        let text = usda("../a.<UDIM>.jpg", 5);
        assert!(
            text.contains("@../a.<UDIM>.jpg@") && text.contains("int[] faceVertexCounts = [4, 4, 4, 4, 4, ]"),
            "{text}"
        );
        assert!(
            text.contains("(1, 1), (2, 1), (2, 2), (1, 2), ]"),
            "1012 lies in the second column of the second row: {text}"
        );
        assert!(text.contains("verticalAperture = 13.3"), "two rows of three columns: {text}");
        assert!(!usda("a@b.png", 1).contains("a@b"), "a name ends no asset path");
        assert!(!text.contains('$'), "nothing is left open: {text}");
    }
}
