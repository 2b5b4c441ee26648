//! `barymap attributes`: data of the vertices of one mesh on those of another.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::Result;
use crate::cli::common::{Common, EmbeddingArguments, Session, anchor_pairs, check_outputs, usage};
use crate::cli::method::{MethodArguments, prepare};
use crate::cli::model_file::ModelFormat;
use crate::cli::rig::{Rig, is_gltf, read_weights, rig_of, write_weights};
use crate::io::attribute_table::{
    AttributeStyle, AttributeTable, Columns, RowStatus, check_attribute_extension, read_attributes, read_colors,
    write_attributes,
};
use crate::tools::attributes::{Attribute, AttributeKind, Fill, VertexStatus, transfer_attributes};
use crate::words::words;

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
    /// Data of the source's vertices: CSV, NPY or PLY, or GLB with a skin for --kind weights;
    /// repeat for more, with as many -o
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
    fill: Fill,
    /// The data on the target's vertices: CSV, NPY or PLY, or for --kind weights the target as GLB
    /// with joints; one for each file
    #[arg(long, short, required = true, num_args = 1..)]
    output: Vec<PathBuf>,
    #[command(flatten)]
    method: MethodArguments,
    #[command(flatten)]
    embedding: EmbeddingArguments,
}

/// Names of the kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum KindName {
    #[default]
    Scalars,
    Colors,
    Weights,
    Labels,
    Vectors,
    Normals,
    Tangents,
}

words! { KindName, "kind", "a kind of data":
    Scalars => "scalars" "Interpolated linearly",
    Colors => "colors" "As scalars; of a mesh file (PLY, OBJ, OFF, glTF) its vertex colours",
    Weights => "weights" "Skin weights: a column for each bone, made to sum to one",
    Labels => "labels" "Names as numbers: never mixed",
    Vectors => "vectors" "Vectors in space, turned with the surface",
    Normals => "normals" "Unit vectors; of a PLY file its normals",
    Tangents => "tangents" "Unit vectors along the surface, with handedness in a fourth column",
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
        for (i, (read, written)) in self.attributes.iter().zip(&self.output).enumerate() {
            if self.kind(i) == KindName::Weights {
                if is_gltf(written) {
                    ModelFormat::of(written, &[ModelFormat::Glb])?;
                    if self.top.is_some_and(|top| top > 8) {
                        return Err(usage("--top", "a GLB file has at most eight weights a vertex", "Give 8 or less"));
                    }
                    continue;
                }
            } else if is_gltf(read) || is_gltf(written) {
                let what = "of glTF files only skin weights are read and written";
                return Err(usage("--kind", what, "Give --kind weights, or name a table"));
            }
            check_attribute_extension(written)?;
        }
        if self.top == Some(0) || (self.top.is_some() && !self.kind.contains(&KindName::Weights)) {
            return Err(usage("--top", "it is about weights, at least one", "Give it with --kind weights"));
        }
        Ok(())
    }

    /// Reads file `i`.
    fn read(&self, i: usize) -> Result<Given> {
        let (path, kind) = (&self.attributes[i], self.kind(i));
        if is_gltf(path) {
            let (columns, values, rig) = read_weights(path)?;
            let kind = AttributeKind::Weights { keep: self.top.unwrap_or(0) };
            let table = AttributeTable { columns, values, ..AttributeTable::default() };
            return Ok(Given { name: path.display().to_string(), kind, table, rig: Some(rig) });
        }
        let columns = match kind {
            _ if !self.columns.is_empty() => Columns::Named(self.columns.clone()),
            KindName::Normals => Columns::Normals,
            _ => Columns::Data,
        };
        let table = if kind == KindName::Colors && self.columns.is_empty() {
            read_colors(path)?
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
        Ok(Given { name: path.display().to_string(), kind, table, rig: None })
    }
}

/// A file of data.
struct Given {
    name: String,
    kind: AttributeKind,
    table: AttributeTable,
    /// Where its columns are joints of a glTF file.
    rig: Option<Rig>,
}

impl Given {
    /// Its numbers, if it has any, and each column of text: names of parts, whatever the numbers
    /// are.
    fn attributes(&self) -> Vec<Attribute> {
        let name = self.name.clone();
        let numbers = Attribute {
            name: name.clone(),
            kind: self.kind,
            columns: self.table.columns.len(),
            values: self.table.values.clone(),
        };
        let texts = self.table.texts.iter().map(|t| Attribute {
            name: format!("{name}: {}", t.name),
            kind: AttributeKind::Labels,
            columns: 1,
            values: t.values.clone(),
        });
        Some(numbers).filter(|a| a.columns > 0).into_iter().chain(texts).collect()
    }

    /// The table with what became of its attributes on the target, the first ones of `carried`.
    fn answer(&self, carried: &mut impl Iterator<Item = Attribute>) -> AttributeTable {
        let mut table = self.table.clone();
        if !table.columns.is_empty() {
            table.values = carried.next().map_or_else(Vec::new, |a| a.values);
        }
        for text in &mut table.texts {
            text.values = carried.next().map_or_else(Vec::new, |a| a.values);
        }
        // Amounts in between whole numbers are none.
        table.storage.integers = table.storage.integers.filter(|_| self.kind == AttributeKind::Labels);
        table
    }
}

/// What of `table` the file at `output` cannot hold.
fn tell_losses(session: &Session<'_>, output: &Path, table: &mut AttributeTable) {
    let ends_in = |e: &str| output.extension().is_some_and(|x| x.eq_ignore_ascii_case(e));
    let holds_text = ends_in("csv") || ends_in("txt");
    let output = output.display();
    if !holds_text && !table.texts.is_empty() && !table.columns.is_empty() {
        let names: Vec<&str> = table.texts.iter().map(|t| t.name.as_str()).collect();
        session.warn(&format!("{output}: columns of text are left out: {}; CSV holds them", names.join(", ")));
    }
    if ends_in("npy") && table.storage.integers.is_some() && table.values.iter().any(|v| v.is_nan()) {
        session.warn(&format!("{output}: written as float64, because vertices without a label are NaN"));
        table.storage.integers = None;
    }
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    arguments.check()?;
    check_outputs(arguments.output.iter().map(PathBuf::as_path))?;
    let mut session = Session::start(common)?;
    let (mut source, mut target) = (session.mesh(&arguments.source)?, session.target(&arguments.target)?);
    let mut files: Vec<Given> = (0..arguments.attributes.len()).map(|i| arguments.read(i)).collect::<Result<_>>()?;
    for (file, output) in files.iter_mut().zip(&arguments.output) {
        if file.rig.is_none() && is_gltf(output) {
            file.rig = Some(rig_of(&file.table.columns, &source, &target)?);
        }
    }
    for file in &files {
        session.warn_of_table(Path::new(&file.name), &file.table.notes);
    }
    let given: Vec<Attribute> = files.iter().flat_map(Given::attributes).collect();
    // Before the costly part.
    given.iter().try_for_each(|a| a.check(&source.mesh))?;
    session.watch.lap("read");
    let anchors = anchor_pairs(&arguments.anchors, &source, &target, &session)?;
    let method = arguments.method;
    let map = prepare(&mut session, &mut source, &mut target, &anchors, method, &arguments.embedding)?;
    let fill = arguments.fill;
    let (from, to) = ((&source.mesh, &source.topology), (&target.mesh, &target.topology));
    let result = transfer_attributes(from, to, map.as_ref(), &given, fill)?;
    session.watch.lap("attributes");
    let status: Vec<RowStatus> = result
        .status
        .iter()
        .zip(&result.map.images)
        .map(|(s, i)| RowStatus { word: s.word(), number: s.number(), confidence: f64::from(i.confidence) })
        .collect();
    let mut carried = result.attributes.iter().cloned();
    for (i, file) in files.iter().enumerate() {
        let mut table = file.answer(&mut carried);
        let output = &arguments.output[i];
        if let Some(rig) = file.rig.as_ref().filter(|_| is_gltf(output)) {
            write_weights(&session, &target, rig, &table.values, arguments.top, output)?;
            continue;
        }
        tell_losses(&session, &arguments.output[i], &mut table);
        let style = AttributeStyle { colors: arguments.kind(i) == KindName::Colors };
        write_attributes(&arguments.output[i], &target.mesh, &table, &status, style)?;
    }
    session.watch.lap("write");
    let count = |s: VertexStatus| result.count(s);
    let d = result.map.distortion;
    let written: Vec<String> = arguments.output.iter().map(|o| o.display().to_string()).collect();
    session.say(&format!(
        "{}: {} vertices by {}: {} valid, {} filled, {} doubtful, {} without anything; by {}",
        written.join(", "),
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
        "attributes": files.iter().map(|f| json!({"name": f.name, "columns": f.table.columns.len() + f.table.texts.len()})).collect::<Vec<_>>(),
    });
    if let (Some(report), Some(extra)) = (report.as_object_mut(), extra.as_object()) {
        report.extend(extra.clone());
    }
    session.write_report(&report)
}
