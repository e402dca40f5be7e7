"""Every place in the rooms that opens a file by itself, and why it may: what a test compares with the code.

Files from elsewhere are read through `groundwork.foreign_file` (`read_regular`, `open_regular`, `parse_json` …), which
this table need not name. Places with a library's own opener are listed with a reason; others fail `test_readers.py`.
"""

from __future__ import annotations

import ast
from functools import cache

LOOKED_AT = "the same function, or the one that calls it, asked check_regular, check_file or is_file first"
GUARDED = "a stage that usd_schemas.guard.guard looked through, in a child with limits, or one that we wrote"
OURS = "written by this run or an earlier one into its own work folder, store or cache"
PACKAGE = "data of the package itself, or the kernel's own files"
WORDS = "words of the command line or of a child of ours, no file"

OPENERS = {
    "np.load",
    "np.memmap",
    "np.fromfile",
    "np.genfromtxt",
    "np.loadtxt",
    "cv2.imread",
    "cv2.VideoCapture",
    "json.load",
    "json.loads",
    "tomllib.load",
    "tomllib.loads",
    "pickle.load",
    "pickle.loads",
    "sqlite3.connect",
    "zipfile.ZipFile",
    "ZipFile",
    "tarfile.open",
    "OpenEXR.File",
    "laspy.open",
    "laspy.read",
    "h5py.File",
    "open",
    "shutil.copyfile",
    "shutil.copy",
    "shutil.copytree",
    "trimesh.load_scene",
    "trimesh.load",
    "torch.load",
    "PIL.Image.open",
    "Image.open",
    "Usd.Stage.Open",
    "Sdf.Layer.FindOrOpen",
    "Sdf.Layer.OpenAsAnonymous",
    "pycolmap.Reconstruction",
    "pycolmap.Database.open",
    "pycolmap.import_images",
    "lazrs.LasZipDecompressor",
    "archive.extractall",
    "package.extractall",
}
METHODS = {"read_bytes", "read_text", "open", "OpenAsset", "extractall"}
NETWORK = {"urllib", "requests", "httpx", "aiohttp", "socket", "ftplib", "http"}
SAFE = {
    "read_regular",
    "open_regular",
    "read_json",
    "read_toml",
    "read_arrays",
    "parse_json",
    "parse_toml",
    "read_picture",
    "decode",
}


@cache
def parsed(source: str) -> ast.Module:
    """Parse a module once for all rules."""
    return ast.parse(source)


@cache
def calls(source: str) -> list[tuple[str, str, ast.Call]]:
    """List the calls of a module once for all rules: in which function (`.C.f`), what, and the call itself."""
    found: list[tuple[str, str, ast.Call]] = []

    def walk(node: ast.AST, place: str) -> None:
        for child in ast.iter_child_nodes(node):
            inner = place
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                inner = f"{place}.{child.name}"
            if isinstance(child, ast.Call):
                found.append((place, _dotted(child.func), child))
            walk(child, inner)

    walk(parsed(source), "")
    return found


def openings(source: str, module: str) -> dict[str, set[str]]:
    """Find the functions that open files by themselves.

    Args:
        source: Text of a module.
        module: Its name without folders.

    Returns:
        `module.function` to what it calls.
    """
    found: dict[str, set[str]] = {}
    for place, name, call in calls(source):
        if (name in OPENERS or name.rpartition(".")[2] in METHODS) and not _writes(call):
            found.setdefault(f"{module}{place}", set()).add(name)
    return found


def _dotted(node: ast.expr) -> str:
    """Spell what is called: `np.load`; of a method of anything else, `.read_bytes`."""
    if isinstance(node, ast.Attribute):
        return f"{_dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def _writes(call: ast.Call) -> bool:
    """Tell whether an `open` is one to write; another rule of the house looks at those."""
    given = [*call.args, *(keyword.value for keyword in call.keywords)]
    modes = [one.value for one in given if isinstance(one, ast.Constant)]
    return any(mode in ("w", "wb", "a", "ab", "x", "xb") for mode in modes)


def safe_readings(source: str, module: str) -> set[str]:
    """Find the functions that read files through the safe opener.

    Args:
        source: Text of a module.
        module: Its name without folders.

    Returns:
        `module.function` of each.
    """
    return {f"{module}{place}" for place, name, _ in calls(source) if name.removeprefix("image_files.") in SAFE}


OPENED_RAW: dict[str, set[str]] = {
    LOOKED_AT: {
        "training_page._log",
        "array_file.read_arrays",
        "checkpoint.read_checkpoint",
        "cloud._load",
        "float_files.decode_exr",
        "texture_files._read",
        "surface_look._decode",
        "panorama._read_exr",
        "mesh._loaded",
        "model_files.unpack",
        "model_files.check_archive",
        "user_maps.Picture.read",
        "usd._unpacked",
        "usd._face_count",
        "usd._facts",
        "textures.copy_texture",
        "package_walk.check_package",
        "package.package_scene",
        "checkout.checkout_scene.write",
        "scan.read_scan",
        "read_las.read_header",
        "read_e57.read_e57",
        "read_numpy.open_array",
        "read_text.read_text",
        "copy_las.copy_las",
        "copy_ply.copy_ply",
        "copy_table.copy_text",
        "copy_table._layout",
        "asset.claims_city",
        "layout._column",
        "read_las.open_las",
        "read_ply.read_ply_header",
        "read_ply._read_binary",
        "read_ply._read_text",
        "unpack_laz.unpack",
        "extraction.extract",
    },
    GUARDED: {
        "surface_work._variants",
        "surface_work.material_color",
        "guard.check_stage",
        "layer_contents._walk",
        "layer_walk.open_layer",
        "package_walk._opened",
        "packages.unpacked",
        "tiles.tiles_of",
        "stage_reader._open",
        "mtlx.Adopted._walk",
        "open_scene.read_product",
        "diff._open",
        "harvest._open",
        "flatten.flatten_scene",
        "asset.read_city",
        "asset.is_city",
        "inventory.take_inventory",
        "validate.validate_scene",
        "add.write_variant",
        "add._ensure",
        "redrawn.check_redrawn",
        "add_survey.add_survey",
        "add_survey._add_product",
        "usd_file.open_foreign",
        "foreign_look._roles",
        "foreign_look._fallbacks",
        "foreign_place.check_place",
        "selection.choose",
        "change.change_layer",
        "staging.check_asset",
    },
    OURS: {
        "photographed_scenes._copy",  # a run of its own
        "preview._answer",
        "preview.photograph_stage",
        "surfaces.read_surfaces",
        "clean._traces",
        "costs.Costs._look",
        "artefact.read_manifest",
        "artefact.seal",
        "cache.cached_pyramid",
        "canonical.source_digest",
        "events.parse_event",
        "events.read_events",
        "export._check_film",
        "export.write_parquet",
        "failures.write_failure",
        "flatten._is_ours",
        "locks.open_locked",
        "marks.read_listing",
        "module.Segmentation.on_load_checkpoint",
        "file.is_signed",
        "folder._said",
        "pieces._columns",
        "repair._clear",
        "store.Store.evict",
        "train._best_weights",
        "train._fit",
        "train._former",
        "stored_model.write_stored_model",
        "scene_cache._kept",
        "scene_file.unpack_scene",
        "bake_down.bake_down",
        "additions._label",
        "foreign_background._dropped",
        "corrections.correct",  # layers in memory
        "labels.write_replicator_layer",
        "geometry.geometry_layer",
        "layer.new_stage",
        "render_settings.render_layer",
        "daylight.encode_exr",
        "library._copy",
        "textures._store",
        "user_sets._decode_exr",
        "journal.Journal.light_volume",
        "preparation_child._apart",
        "preparation_child._serve",
        "database.count_rows",
        "database.empty_journal",
        "database.paired",
        "database._attached",
        "dense_child.DepthMaps.image",
        "dense_child.DepthMaps.depth",
        "dense_child.DepthMaps.marks",
        "points.read_points",
        "pixel_fates.PixelFates.of",
        "depth_colmap.read_depth_map",
        "mapping.transform",
        "mapping._map_globally",
        "matching.match_share",
        "matching._take_over",
        "matching._name_pairs",
        "matching._verified",
        "tie_points.write_tie_points",
        "doubtful._pair_geometry",
    },
    PACKAGE: {
        "class_map._toml",
        "class_map.read_class_map",
        "clouds.demo_clouds",
        "components.class_rows",
        "components.component_classes",
        "taxonomies.taxonomy",
        "camera_models.camera_models",
        "preset.preset_values",
        "programs._source",
        "doctor._available_memory",
        "memory.read_kernel_file",
        "platform.processor",
        "page._template",
        "page.figure_json",
        "child._resident",
        "child._waited",
    },
    WORDS: {"child.answer_parent", "child._hear", "given_settings.given_settings", "cli.main"},
}

# Format of a foreign file to the functions that read it; `mutated_reading.py` mutates a sample of each: of E57, where
# its package is installed.
FORMATS: dict[str, set[str]] = {
    "scenario": {"settings.read_toml", "scenario.load_scenario"},
    "capture": {"capture._read_capture"},
    "poses": {"capture._read_truth"},
    "instances": {"capture._read_truth"},
    "surface": {"truth_checks.read_surface"},
    "depth": {"capture.Truth._image", "image_files.decode"},
    "semantic": {"capture.Truth._image"},
    "instance": {"capture.Truth._image"},
    "photograph": {"capture.load_image", "textures._decode", "export._copy_images", "cameras._copy_photographs"},
    "header": {"photo_header.read_header", "image_files.size"},
    "dome": {"daylight._decode_panorama", "float_files.decode_float"},
    "tga": {"tga.decode_tga"},
    "mtlx": {"mtlx.read_document"},
    "cloud": {"cloud._read_description"},
    "column": {"cloud._read_description"},
    "las": {"scan.read_scan"},
    "laz": {"scan.read_scan"},
    "ply scan": {"scan.read_scan"},
    "array": {"read_numpy.open_array"},
    "records": {"read_numpy.open_array"},
    "text": {"read_text.read_text"},
    "e57": {"read_e57.read_e57"},
    "model": {"trained.read_facts"},
    "weights": {"trained.read_weights"},
    "forest": {"trained.read_weights"},
    "checkpoint": {"checkpoint.read_checkpoint"},
    "colmap": {"colmap_model.read_model", "cameras.write_colmap", "cameras.write_nerfstudio"},
    "obj": {"mesh.read_obj", "model_files.read_beside"},
    "ply": {"mesh.read_ply"},
    "gltf": {"gltf.GltfFile.read"},
    "usd world": {"usd._image", "apis.read_component"},
    "zip": {"model_files.unpack"},
    "cityjson": {"cityjson._documents"},
    "sky": {"panorama._read_radiance"},
    "surfaces": {"user_maps.Picture.read"},
    "manifest": {"manifest._read", "own_files.own_files"},
    "artefact": {"files.read_json"},
    "stage": {"stage_reader._open"},
    "package": {"package_walk.check_package"},
}

# Read through the safe opener though no stranger makes them, or only bytes that are handed on.
READ_SAFELY_ANYHOW = {
    # pages and answers: JSON of our outputs, through read_json
    "answers.cloud_facts",
    "comparison_page.read_comparison",
    "flight._reconstructed",
    "flight.small_picture",
    "photographed_scenes._copy",
    "report._recipe",
    "report._settings",
    "residuals.stored_cameras",
    "claim._says",
    "foreign._listed",  # names alone
    "run_facts._failures",
    "run_facts._scene",
    "run_facts._scene_of",
    "run_facts.run_facts",
    "saved.title_words",
    "training_page._model",
    "training_page.read_evaluation",
    "costs._stored_sizes",
    "failures.read_failure",
    "asset.read_city",
    "asset._images",  # a world that `background import` wrote
    "canonical.file_digest",
    "harvest._write",
    "textures.copy_texture",  # bytes, hashed or copied
    "journal.Journal.is_complete",
    "journal.Journal.gain",
    "journal.Journal._read",
    "library.copy_sheet",
    "library._whole",
    "steps.take_step",
    "labeled_cloud.identify",
    "layout.read_facts",
    "predict._boxes_record",
    "given_files.need_scenario",
    "train_verbs._is_evaluation",
    "verbs._title",
    "compared_bridges._told",
    "compare_plan._points",
    "comparison.Experiment.read_trials",
    "preset.preset_values",
    "noise._places",
    "origins.origin_of",
    "pieces._read",
    "pieces.counts_of",
    "run_verbs._few",
    "verification._starts_from_a_stage",  # ours
    "scan_stream.magic_of",  # four bytes
    # tested with their own rooms
    "class_map._read",
    "ground_control.read_ground_control",
    "stored_model.read_stored_model",
}
