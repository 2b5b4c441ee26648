//! CSV: markers as a table.
//!
//! Wide, one row a frame: `time,LKNE.x,LKNE.y,LKNE.z,...` (`_x`, `:x`, ` x` and capitals are as
//! good). Long, one row a marker and frame: `time,marker,x,y,z`. The first column may be `frame`
//! instead of `time`, or there may be both. The file is a [`Table`] of any dialect; empty cells are
//! gaps. Comments begin with `#`; `# rate: 120` and `# units: mm` tell what columns cannot. Tables
//! of Motive (OptiTrack) are read by [`super::optitrack`].

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use glam::DVec3;

use super::{Clip, MAX_POSITIONS, Motion, check_size, optitrack, shortened, unit};
use crate::io::encoding;
use crate::io::source::Notes;
use crate::io::table::Table;
use crate::{Error, Result};

/// Reads markers from a CSV file.
///
/// Rows are placed by their frame number or, without one, by their time, so that dropped frames
/// become gaps.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] naming the line: a header of no known form, a cell that is not
/// a number, times that are not evenly spaced.
pub fn read_csv(path: impl AsRef<Path>) -> Result<Motion> {
    let path = path.as_ref();
    let text = encoding::read_text(path)?;
    let mut motion = parse(&text.text, path)?;
    motion.warnings.extend(text.note);
    Ok(motion)
}

/// What the columns are.
struct Columns {
    frame: Option<usize>,
    time: Option<usize>,
    form: Form,
}

enum Form {
    /// Names, and for each the columns of x, y and z.
    Wide(Vec<String>, Vec<[usize; 3]>),
    /// Columns of the name, x, y and z.
    Long(usize, [usize; 3]),
}

/// A row: its line, frame number and time if there are any, and positions of markers.
pub(super) struct Row {
    pub(super) line: usize,
    pub(super) frame: Option<f64>,
    pub(super) time: Option<f64>,
    pub(super) points: Vec<(usize, DVec3)>,
}

pub(super) fn parse(text: &str, path: &Path) -> Result<Motion> {
    let mut table = Table::parse_text(text, path)?;
    if optitrack::is_motive(&table) {
        return optitrack::parse(table);
    }
    let (mut rate, mut metres) = (None, None);
    for comment in text.lines().filter_map(|line| line.trim().strip_prefix('#')) {
        match comment.split_once([':', '=']).map(|(k, v)| (k.trim().to_ascii_lowercase(), v.trim())) {
            Some((key, value)) if key == "rate" => rate = value.parse::<f64>().ok(),
            Some((key, value)) if key == "units" || key == "unit" => metres = unit(value),
            _ => {}
        }
    }
    let line = (!table.is_empty()).then(|| table.line(0));
    table.lift_header(|_, _| true);
    let Some(header) = table.names() else {
        return Err(Error::format(
            path,
            None,
            "there is no header",
            "Begin with a line such as time,LKNE.x,LKNE.y,LKNE.z",
        ));
    };
    let Columns { frame, time, form } = Columns::parse(&header, path, line)?;
    let mut read: Vec<usize> = [frame, time].into_iter().flatten().collect();
    match &form {
        Form::Wide(_, triples) => read.extend(triples.iter().flatten()),
        Form::Long(_, triple) => read.extend(triple),
    }
    table.settle_decimals(&read)?;
    let mut names: Vec<String> = match &form {
        Form::Wide(names, _) => names.clone(),
        Form::Long(..) => Vec::new(),
    };
    let mut known: HashMap<String, usize> = HashMap::new();
    let mut rows: Vec<Row> = Vec::new();
    for r in 0..table.len() {
        let (count, width) = (table.cells(r), table.width());
        if (width..count).any(|c| !table.cell(r, c).is_empty()) {
            let what = format!("{count} cells where the header has {width}");
            return Err(table.fail(r, what, "Correct the row; numbers need a decimal point, not a comma"));
        }
        let number = |column: Option<usize>| -> Result<Option<f64>> {
            let Some(column) = column.filter(|&c| !table.cell(r, c).is_empty()) else { return Ok(None) };
            match table.number(r, column).filter(|x| x.is_finite()) {
                Some(x) => Ok(Some(x)),
                None => {
                    let what = format!("{:?} is not a frame number or time", shortened(table.cell(r, column)));
                    Err(table.fail(r, what, "Correct the cell"))
                }
            }
        };
        let (frame, time) = (number(frame)?, number(time)?);
        let mut points = Vec::new();
        match &form {
            Form::Wide(names, triples) => {
                check_size(path, rows.len(), names.len())?;
                for (k, (name, triple)) in names.iter().zip(triples).enumerate() {
                    points.extend(point(&table, r, triple, name)?.map(|p| (k, p)));
                }
            }
            Form::Long(name, triple) => {
                let name = table.cell(r, *name);
                let k = *known.entry(name.to_owned()).or_insert_with(|| {
                    names.push(name.to_owned());
                    names.len() - 1
                });
                points.extend(point(&table, r, triple, name)?.map(|p| (k, p)));
            }
        }
        rows.push(Row { line: table.line(r), frame, time, points });
    }
    let mut notes = Notes::default();
    table.notes().iter().for_each(|note| notes.say(note.clone()));
    assemble(path, names, rows, matches!(form, Form::Long(..)), rate, metres, notes)
}

/// Three cells of a row as a position; a gap if one of them is empty, missing or not finite.
pub(super) fn point(table: &Table, row: usize, columns: &[usize; 3], name: &str) -> Result<Option<DVec3>> {
    let mut xyz = [f64::NAN; 3];
    for (x, &column) in xyz.iter_mut().zip(columns) {
        let cell = table.cell(row, column);
        if cell.is_empty() {
            return Ok(None);
        }
        *x = table.number(row, column).ok_or_else(|| {
            let what = format!("marker {}: {:?} is not a number", shortened(name), shortened(cell));
            table.fail(row, what, "Write numbers with a decimal point, and leave gaps empty")
        })?;
    }
    let p = DVec3::from(xyz);
    Ok(p.is_finite().then_some(p))
}

impl Columns {
    fn parse(header: &[&str], path: &Path, line: Option<usize>) -> Result<Self> {
        let lower: Vec<String> = header.iter().map(|h| h.to_lowercase()).collect();
        let find = |names: &[&str]| lower.iter().position(|h| names.contains(&h.as_str()));
        let frame = find(&["frame", "frame#", "frames", "index"]);
        let time = find(&["time", "t", "time (s)", "time_s", "seconds", "timestamp"]);
        if let (Some(name), Some(x), Some(y), Some(z)) =
            (find(&["marker", "name", "label", "joint"]), find(&["x"]), find(&["y"]), find(&["z"]))
        {
            return Ok(Self { frame, time, form: Form::Long(name, [x, y, z]) });
        }
        let (mut names, mut triples) = (Vec::new(), Vec::new());
        let mut index = HashMap::new();
        for (column, title) in header.iter().enumerate() {
            let Some(axis) = lower[column].chars().last().and_then(|c| "xyz".find(c)) else { continue };
            let stem = title[..title.len() - 1].trim_end();
            let Some(name) =
                stem.strip_suffix(['.', '_', ':', '-', '/']).or((stem.len() + 1 < title.len()).then_some(stem))
            else {
                continue;
            };
            let k = *index.entry(name).or_insert_with(|| {
                names.push(name.to_owned());
                triples.push([usize::MAX; 3]);
                names.len() - 1
            });
            triples[k][axis] = column;
        }
        if let Some(k) = triples.iter().position(|t| t.contains(&usize::MAX)) {
            let what = format!("marker {:?} lacks one of its columns x, y and z", shortened(&names[k]));
            return Err(Error::format(path, line, what, "Give three columns a marker"));
        }
        if names.is_empty() {
            let what = "the header names no marker";
            let remedy = "Write time,LKNE.x,LKNE.y,LKNE.z,... or time,marker,x,y,z";
            return Err(Error::format(path, line, what, remedy));
        }
        Ok(Self { frame, time, form: Form::Wide(names, triples) })
    }
}

/// Puts the rows into their frames.
pub(super) fn assemble(
    path: &Path,
    names: Vec<String>,
    rows: Vec<Row>,
    long: bool,
    rate: Option<f64>,
    metres: Option<f64>,
    notes: Notes,
) -> Result<Motion> {
    let all = |f: fn(&Row) -> Option<f64>| rows.iter().map(f).collect::<Option<Vec<f64>>>();
    let (numbers, times) = (all(|r| r.frame), all(|r| r.time));
    let step = times.as_deref().and_then(usual_step);
    let places: Vec<usize> = match (&numbers, &times) {
        (Some(numbers), _) => evenly_placed(path, &rows, numbers, 1.0)?,
        (None, Some(times)) => evenly_placed(path, &rows, times, step.unwrap_or(1.0))?,
        (None, None) if long => {
            let what = "rows of single markers need a frame number or a time each";
            return Err(Error::format(path, rows.first().map(|r| r.line), what, "Add a column frame or time"));
        }
        (None, None) => (0..rows.len()).collect(),
    };
    let rate = rate.or_else(|| measured_rate(&places, times.as_deref()?));
    let count = places.iter().max().map_or(0, |&m| m + 1);
    check_size(path, count, names.len())?;
    let mut clip = Clip::new(path, names, notes)?;
    let mut by_frame: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (k, &place) in places.iter().enumerate() {
        by_frame.entry(place).or_default().push(k);
    }
    for f in 0..count {
        let mut frame = vec![None; clip.names.len()];
        let mut line = None;
        for &k in by_frame.get(&f).into_iter().flatten() {
            line = Some(rows[k].line);
            for &(m, p) in &rows[k].points {
                if frame[m].replace(p).is_some() {
                    let what = format!("marker {:?} is there twice in frame {f}", shortened(&clip.names[m]));
                    return Err(Error::format(path, line, what, "Give one row a marker and frame"));
                }
            }
        }
        clip.push(frame, line)?;
    }
    clip.finish(rate, metres)
}

/// The median of the differences between successive distinct times.
fn usual_step(times: &[f64]) -> Option<f64> {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    let span = sorted.last()? - sorted.first()?;
    let mut steps: Vec<f64> = sorted.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 1e-9 * span).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied()
}

/// Frames per second: distance of the frames over the time between them.
fn measured_rate(places: &[usize], times: &[f64]) -> Option<f64> {
    let first = (0..places.len()).min_by_key(|&k| places[k])?;
    let last = (0..places.len()).max_by_key(|&k| places[k])?;
    let (frames, seconds) = (places[last] - places[first], times[last] - times[first]);
    (frames > 0 && seconds > 0.0).then(|| frames as f64 / seconds)
}

/// Indices of frames from values whose neighbours are multiples of `step` apart. Equal values are
/// one frame.
fn evenly_placed(path: &Path, rows: &[Row], values: &[f64], step: f64) -> Result<Vec<usize>> {
    let mut order: Vec<usize> = (0..rows.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut places = vec![0; rows.len()];
    for pair in order.windows(2) {
        // From neighbour to neighbour, because times that are rounded in the file drift away from a
        // rounded step.
        let steps = (values[pair[1]] - values[pair[0]]) / step;
        if !(steps < MAX_POSITIONS as f64) || (steps - steps.round()).abs() > 0.3 {
            let what = format!("{} after {}: frames are not evenly spaced", values[pair[1]], values[pair[0]]);
            return Err(Error::format(path, Some(rows[pair[1]].line), what, "Resample the markers at an even rate"));
        }
        places[pair[1]] = places[pair[0]] + steps.round() as usize;
        check_size(path, places[pair[1]], 1)?;
    }
    Ok(places)
}
