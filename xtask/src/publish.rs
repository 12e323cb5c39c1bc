//! Manifests of published packages: what the registry shows, and that everything they need is published, too.
//!
//! `.ci/package` makes the packages and checks their sizes.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use serde::Deserialize;

use crate::workspace::Workspace;

/// The registry refuses longer lists.
const MOST_KEYWORDS: usize = 5;
/// The categories in use, as in crates.io's `src/boot/categories.toml`. The registry ignores unknown ones.
const CATEGORIES: [&str; 12] = [
    "algorithms",
    "command-line-utilities",
    "computer-vision",
    "data-structures",
    "graphics",
    "mathematics",
    "multimedia::images",
    "rendering",
    "rendering::data-formats",
    "rust-patterns",
    "science",
    "visualization",
];
const LICENCES: [&str; 2] = ["LICENSE-APACHE", "LICENSE-MIT"];

/// Missing fields and files of published packages, dependencies on unpublished packages, versions that do not fit.
pub fn problems(workspace: &Workspace) -> anyhow::Result<Vec<String>> {
    let published: BTreeMap<_, _> =
        workspace.packages.iter().map(|package| (package.name.as_str(), package.is_published)).collect();
    let root: RootManifest = read(&workspace.root)?;
    let mut problems = against_versions(&root.workspace, &published);
    for package in workspace.packages.iter().filter(|package| package.is_published) {
        let folder = workspace.root.join(&package.folder);
        let mut own = against_registry(&read::<Manifest>(&folder)?.package, &folder);
        own.extend(different_licences(&workspace.root, &folder)?);
        let unpublished = package.dependencies.iter().filter(|other| published.get(other.as_str()) != Some(&true));
        own.extend(unpublished.map(|other| format!("it depends on {other}, which is not published")));
        problems.extend(own.iter().map(|problem| format!("{}: {problem}", package.name)));
    }
    Ok(problems)
}

#[derive(Deserialize)]
struct RootManifest {
    workspace: Members,
}

#[derive(Deserialize)]
struct Members {
    package: Common,
    dependencies: BTreeMap<String, toml::Value>,
}

#[derive(Deserialize)]
struct Common {
    version: String,
}

#[derive(Deserialize)]
struct Manifest {
    package: Fields,
}

#[derive(Default, Deserialize)]
#[serde(default)]
struct Fields {
    description: String,
    readme: String,
    keywords: Vec<String>,
    categories: Vec<String>,
    /// Paths from the package's folder that begin with a slash; no patterns.
    include: Vec<String>,
}

fn read<T: for<'de> Deserialize<'de>>(folder: &Path) -> anyhow::Result<T> {
    let path = folder.join("Cargo.toml");
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    toml::from_str(&text).with_context(|| path.display().to_string())
}

/// Published packages are released together and depend on each other in exactly one version. A version of an
/// unpublished package would stay in the manifests that `cargo package` writes.
fn against_versions(root: &Members, published: &BTreeMap<&str, bool>) -> Vec<String> {
    let expected = format!("={}", root.package.version);
    let mut problems = Vec::new();
    for (name, &is_published) in published {
        let Some(dependency) = root.dependencies.get(*name) else { continue };
        let version = dependency.get("version").and_then(toml::Value::as_str);
        if version != is_published.then_some(expected.as_str()) {
            let needed = if is_published { format!("version \"{expected}\"") } else { "no version".to_owned() };
            problems.push(format!("{name} in [workspace.dependencies] must have {needed}"));
        }
    }
    problems
}

fn against_registry(fields: &Fields, folder: &Path) -> Vec<String> {
    let mut problems = Vec::new();
    for (is_missing, field) in [
        (fields.description.is_empty(), "description"),
        (fields.readme.is_empty(), "readme"),
        (fields.keywords.is_empty(), "keywords"),
        (fields.categories.is_empty(), "categories"),
        (fields.include.is_empty(), "include"),
    ] {
        if is_missing {
            problems.push(format!("it is published without `{field}`"));
        }
    }
    if fields.keywords.len() > MOST_KEYWORDS {
        problems.push(format!("it has {} keywords; at most {MOST_KEYWORDS} are accepted", fields.keywords.len()));
    }
    let unknown = fields.categories.iter().filter(|category| !CATEGORIES.contains(&category.as_str()));
    problems.extend(unknown.map(|category| format!("the category {category} is not in xtask's list")));
    let readme = Some(format!("/{}", fields.readme)).filter(|_| !fields.readme.is_empty());
    if let Some(readme) = readme.filter(|readme| !fields.include.contains(readme)) {
        problems.push(format!("`include` lacks {readme}"));
    }
    for path in &fields.include {
        // Of a pattern with a wildcard, its folder has to exist.
        let fixed = path.split_once('*').map_or(path.as_str(), |(before, _)| before);
        if !fixed.strip_prefix('/').is_some_and(|path| folder.join(path).exists()) {
            problems.push(format!("`include` lists {path}, which does not exist"));
        }
    }
    problems
}

/// Copies of the licences, for packages that are distributed alone.
fn different_licences(root: &Path, folder: &Path) -> anyhow::Result<Vec<String>> {
    let mut problems = Vec::new();
    for name in LICENCES.into_iter().filter(|name| folder.join(name).exists()) {
        if std::fs::read(folder.join(name))? != std::fs::read(root.join(name))? {
            problems.push(format!("{name} differs from the repository's"));
        }
    }
    Ok(problems)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn versions_are_those_of_published_packages() {
        let root: RootManifest = toml::from_str(
            "[workspace.package]\nversion = \"1.2.3\"\n[workspace.dependencies]\na = { path = \"a\", version = \"=1.2.3\" }\n\
            b = { path = \"b\" }\nc = { path = \"c\" }\nd = { path = \"d\", version = \"=1.2.3\" }\nserde = \"1.0\"\n",
        )
        .unwrap();
        let published = [("a", true), ("b", false), ("c", true), ("d", false), ("e", true)].into();
        assert_eq!(
            against_versions(&root.workspace, &published),
            [
                "c in [workspace.dependencies] must have version \"=1.2.3\"",
                "d in [workspace.dependencies] must have no version"
            ]
        );
    }

    #[test]
    fn fields_for_the_registry_are_complete() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        assert_eq!(against_registry(&Fields::default(), folder).len(), 5);
        let text = "description = \"d\"\nreadme = \"Cargo.toml\"\nkeywords = [\"k\"]\ncategories = [\"graphics\"]\n\
            include = [\"/src\", \"/Cargo.toml\"]\n";
        let fields: Fields = toml::from_str(text).unwrap();
        assert_eq!(against_registry(&fields, folder), [""; 0]);
        let text = text.replace("graphics", "lighting").replace("/Cargo.toml", "/none");
        assert_eq!(
            against_registry(&toml::from_str(&text).unwrap(), folder),
            [
                "the category lighting is not in xtask's list",
                "`include` lacks /Cargo.toml",
                "`include` lists /none, which does not exist"
            ]
        );
    }
}
