//! `barymap attributes`: data of the vertices of one mesh on those of another.

use std::path::PathBuf;

use barymap::Result;
use barymap::io::attribute_table::{
    AttributeStyle, AttributeTable, Columns, RowStatus, check_attribute_extension, read_attributes, read_colors,
    write_attributes,
};
use barymap::tools::attributes::{Attribute, AttributeKind, Fill, VertexStatus, transfer_attributes};
use clap::ValueEnum;
use serde_json::json;

use crate::common::{Common, EmbeddingArguments, Session, anchor_pairs, check_outputs, usage};
use crate::method::{MethodArguments, prepare};

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// The mesh with the data
    #[arg(long)]
    source: PathBuf,
    /// The mesh that receives them
    #[arg(long)]
    target: PathBuf,
    /// Pairs of anchors: JSON, lines `iS iT`, or two files `S.vts,T.vts`
    #[arg(long)]
    anchors: String,
    /// Data of the source's vertices: CSV, NPY or PLY; repeat for more, with as many -o
    #[arg(long, required = true, num_args = 1..)]
    attributes: Vec<PathBuf>,
    /// What a file holds, once per file in their order; files without hold scalars
    #[arg(long, value_enum)]
    kind: Vec<KindName>,
    /// Take only these columns, by name
    #[arg(long, value_delimiter = ',')]
    columns: Vec<String>,
    /// Keep only the largest so many weights of a vertex
    #[arg(long)]
    top: Option<usize>,
    /// What vertices get that the map does not vouch for
    #[arg(long, value_enum, default_value = "smooth")]
    fill: FillName,
    /// The data on the target's vertices: CSV, NPY or PLY; one for each file
    #[arg(long, short, required = true, num_args = 1..)]
    output: Vec<PathBuf>,
    #[command(flatten)]
    method: MethodArguments,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

/// Names of the kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum KindName {
    /// Interpolated linearly
    #[default]
    Scalars,
    /// As scalars; of a mesh file (PLY, OBJ, OFF, glTF) its vertex colours
    Colors,
    /// Skin weights: a column for each bone, made to sum to one
    Weights,
    /// Names as numbers: never mixed
    Labels,
    /// Vectors in space, turned with the surface
    Vectors,
    /// Unit vectors; of a PLY file its normals
    Normals,
    /// Unit vectors along the surface, with handedness in a fourth column
    Tangents,
}

/// Names of what vertices get that the map does not vouch for.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum FillName {
    /// The smoothest values between valid vertices
    Smooth,
    /// The best guess, or nothing
    None,
}

impl Arguments {
    fn kind(&self, file: usize) -> KindName {
        self.kind.get(file).copied().unwrap_or_default()
    }

    fn check(&self) -> Result<()> {
        if self.output.len() != self.attributes.len() {
            let what = format!("{} outputs for {} files of data", self.output.len(), self.attributes.len());
            return Err(usage("--output", &what, "Give one -o for each file"));
        }
        if self.kind.len() > self.attributes.len() {
            let what = format!("{} kinds for {} files of data", self.kind.len(), self.attributes.len());
            return Err(usage("--kind", &what, "Give one for each file, in their order"));
        }
        if self.top == Some(0) || (self.top.is_some() && !self.kind.contains(&KindName::Weights)) {
            return Err(usage("--top", "it is about weights, at least one", "Give it with --kind weights"));
        }
        Ok(())
    }

    /// Reads file `i` as an attribute, with the names of its columns.
    fn read(&self, i: usize, session: &Session<'_>) -> Result<(Attribute, Vec<String>)> {
        let (path, kind) = (&self.attributes[i], self.kind(i));
        let columns = match kind {
            _ if !self.columns.is_empty() => Columns::Named(self.columns.clone()),
            KindName::Normals => Columns::Normals,
            _ => Columns::Data,
        };
        let table = if kind == KindName::Colors && self.columns.is_empty() {
            let (table, notes) = read_colors(path)?;
            notes.iter().for_each(|note| session.warn(&format!("{}: {note}", path.display())));
            table
        } else {
            read_attributes(path, &columns)?
        };
        let kind = match kind {
            KindName::Scalars | KindName::Colors => AttributeKind::Scalars,
            KindName::Weights => AttributeKind::Weights { keep: self.top.unwrap_or(0) },
            KindName::Labels => AttributeKind::Labels,
            KindName::Vectors => AttributeKind::Vectors,
            KindName::Normals => AttributeKind::Normals,
            KindName::Tangents => AttributeKind::Tangents,
        };
        let name = path.display().to_string();
        Ok((Attribute { name, kind, columns: table.columns.len(), values: table.values }, table.columns))
    }
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    arguments.check()?;
    arguments.output.iter().try_for_each(check_attribute_extension)?;
    check_outputs(arguments.output.iter().map(PathBuf::as_path))?;
    let mut session = Session::start(common)?;
    let (mut source, mut target) = (session.mesh(&arguments.source)?, session.mesh(&arguments.target)?);
    let (given, names): (Vec<Attribute>, Vec<Vec<String>>) = (0..arguments.attributes.len())
        .map(|i| arguments.read(i, &session))
        .collect::<Result<Vec<_>>>()?
        .into_iter()
        .unzip();
    // Before the costly part.
    given.iter().try_for_each(|a| a.check(&source.mesh))?;
    session.watch.lap("read");
    let anchors = anchor_pairs(&arguments.anchors, &source, &target, &session)?;
    let method = arguments.method;
    let map = prepare(&mut session, &mut source, &mut target, &anchors, method, &arguments.embedding)?;
    let fill = match arguments.fill {
        FillName::Smooth => Fill::Smooth,
        FillName::None => Fill::None,
    };
    let (from, to) = ((&source.mesh, &source.topology), (&target.mesh, &target.topology));
    let result = transfer_attributes(from, to, map.as_ref(), &given, fill)?;
    session.watch.lap("attributes");
    let status: Vec<RowStatus> = result
        .status
        .iter()
        .zip(&result.map.images)
        .map(|(s, i)| RowStatus { word: s.word(), number: s.number(), confidence: f64::from(i.confidence) })
        .collect();
    for (i, (attribute, columns)) in result.attributes.iter().zip(names).enumerate() {
        let table = AttributeTable { columns, values: attribute.values.clone() };
        let style = AttributeStyle { colors: arguments.kind(i) == KindName::Colors };
        write_attributes(&arguments.output[i], &target.mesh, &table, &status, style)?;
    }
    session.watch.lap("write");
    let count = |s: VertexStatus| result.count(s);
    let d = result.map.distortion;
    session.say(&format!(
        "{}: {} vertices by {}: {} valid, {} filled, {} doubtful, {} without anything; by {}",
        arguments.output[0].display(),
        result.status.len(),
        method.name(),
        count(VertexStatus::Valid),
        count(VertexStatus::Filled),
        count(VertexStatus::Doubtful),
        count(VertexStatus::Failed),
        session.engine.description(),
    ));
    let mut report = session.report("attributes");
    let extra = json!({
        "method": method.name(),
        "anchors": anchors.len(),
        "vertices": result.status.len(),
        "valid": count(VertexStatus::Valid),
        "filled": count(VertexStatus::Filled),
        "doubtful": count(VertexStatus::Doubtful),
        "failed": count(VertexStatus::Failed),
        "valid_fraction": result.map.valid_fraction,
        "flipped_area": d.flipped_area,
        "flipped_faces": d.flipped_faces,
        "stretch_all": d.stretch_all,
        "stretch_best95": d.stretch_best95,
        "stress": {
            "source": source.embedding.as_ref().map(|e| e.stress),
            "target": target.embedding.as_ref().map(|e| e.stress),
        },
        "attributes": result.attributes.iter().map(|a| json!({"name": a.name, "columns": a.columns})).collect::<Vec<_>>(),
    });
    if let (Some(report), Some(extra)) = (report.as_object_mut(), extra.as_object()) {
        report.extend(extra.clone());
    }
    session.write_report(&report)
}
