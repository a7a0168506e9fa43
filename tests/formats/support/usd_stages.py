"""Random stages of OpenUSD by usd-core, and its readings of stages: the reference of our reader and writer.

`write FOLDER COUNT SEED` writes random stages, and their splats as usd-core evaluates them to expected.json.
`read FILES` prints the same for other stages, with the faults that the validators of usd-core find, and writes the root
layer of each again, as again-NAME.usda and .usdc.
`dump FILES` prints the up axis and the faults of stages with one prim of float32 arrays, and writes these to FILE.ATTRIBUTE.
"""

import json
import random
import sys
from pathlib import Path

from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils, UsdValidation, Vt

TYPE = "ParticleField3DGaussianSplat"
HARMONICS = "radiance:sphericalHarmonicsCoefficients"
ARRAYS = {
    "positions": (3, Vt.Vec3fArray, Vt.Vec3hArray),
    "scales": (3, Vt.Vec3fArray, Vt.Vec3hArray),
    "orientations": (4, Vt.QuatfArray, Vt.QuathArray),
    "opacities": (1, Vt.FloatArray, Vt.HalfArray),
    HARMONICS: (3, Vt.Vec3fArray, Vt.Vec3hArray),
}
ELEMENTS = {
    Vt.Vec3fArray: Gf.Vec3f,
    Vt.Vec3hArray: Gf.Vec3h,
    Vt.QuatfArray: Gf.Quatf,
    Vt.QuathArray: Gf.Quath,
    Vt.FloatArray: float,
    Vt.HalfArray: float,
}


def numbers(count, low=-1.0, high=1.0):
    """Random numbers; whole ones at times, which binary layers store in another way."""
    digits = random.choice([0, 1, 9])
    return [round(random.uniform(low, high), digits) for _ in range(count)]


def add_operations(xform):
    """Adds up to five random operations, with pivots and inverses."""
    for k in range(random.randint(0, 5)):
        kind = random.choice(
            ["translate", "rotate1", "rotate3", "orient", "scale", "matrix", "pivot", "axis", "reset", "none"]
        )
        name, precision = f"n{k}", random.choice([UsdGeom.XformOp.PrecisionFloat, UsdGeom.XformOp.PrecisionDouble])
        vector = Gf.Vec3f if precision == UsdGeom.XformOp.PrecisionFloat else Gf.Vec3d
        if kind == "translate":
            xform.AddTranslateOp(precision, name).Set(vector(*numbers(3, -9, 9)))
        elif kind == "rotate1":
            getattr(xform, f"AddRotate{random.choice('XYZ')}Op")(precision, name).Set(numbers(1, -180, 180)[0])
        elif kind == "rotate3":
            axes = random.choice(["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"])
            getattr(xform, f"AddRotate{axes}Op")(precision, name).Set(vector(*numbers(3, -180, 180)))
        elif kind == "orient":
            quaternion = Gf.Quatf if precision == UsdGeom.XformOp.PrecisionFloat else Gf.Quatd
            xform.AddOrientOp(precision, name).Set(quaternion(*[random.uniform(0.1, 1) for _ in range(4)]))
        elif kind == "scale":
            sizes = numbers(3, 0.3, 3) if random.random() < 0.5 else 3 * [random.choice([-1, 1]) * random.uniform(0.3, 3)]
            xform.AddScaleOp(precision, name).Set(vector(*[size or 1 for size in sizes]))
        elif kind == "matrix":
            turn = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 2, 3), random.uniform(0, 90)))
            xform.AddTransformOp(UsdGeom.XformOp.PrecisionDouble, name).Set(
                turn * Gf.Matrix4d().SetTranslate(Gf.Vec3d(*numbers(3)))
            )
        elif kind == "pivot":
            xform.AddTranslateOp(precision, name).Set(vector(*numbers(3, -9, 9)))
            xform.AddRotateYOp(precision, name).Set(random.uniform(0, 360))
            xform.AddTranslateOp(precision, name, True)
        elif kind == "axis":
            getattr(xform, f"AddTranslate{random.choice('XYZ')}Op")(precision, name).Set(random.uniform(-9, 9))
        elif kind == "reset" and random.random() < 0.3:
            xform.SetResetXformStack(True)
        elif kind == "none":
            xform.AddTranslateOp(precision, name)


def add_splats(stage, path, time):
    """Defines splats with random precision, degree, lengths, time samples and hints."""
    prim = stage.DefinePrim(path, TYPE)
    count = random.choice([0, 1, 3, 15, 16, 40, 300])
    degree = random.randint(0, 3)
    prim.GetAttribute("radiance:sphericalHarmonicsDegree").Set(degree)
    for name, (width, *types) in ARRAYS.items():
        length = count * ((degree + 1) ** 2 if name == HARMONICS else 1)
        fate = random.random()
        if name != "positions" and fate < 0.08:
            continue
        if name != "positions" and fate < 0.2:
            length = max(0, length + random.choice([-1, 5]))
        low = 0.05 if name in ("scales", "opacities") else -1
        for is_half in random.choice([[False], [False], [True], [True, False]]):
            array = types[is_half]

            def values(array=array, width=width, length=length, low=low):
                flat = numbers(width * length, low) if random.random() < 0.9 else width * length * [0.5]
                if name in ("orientations", "scales"):
                    flat = [value or 0.25 for value in flat]
                element = ELEMENTS[array]
                return array([element(*flat[k : k + width]) for k in range(0, width * length, width)])

            attribute = prim.GetAttribute(name + ("h" if is_half else ""))
            if random.random() < 0.15:
                for at in random.sample([time - 3, time, time + 2, time + 7], random.randint(1, 4)):
                    attribute.Set(values(), at)
            else:
                attribute.Set(values())
    if random.random() < 0.5:
        prim.GetAttribute("sortingModeHint").Set(random.choice(["zDepth", "cameraDistance", "rayHitDistance"]))
    xform = UsdGeom.Xformable(prim)
    add_operations(xform)
    fate = random.random()
    if fate < 0.06:
        UsdGeom.Imageable(prim).MakeInvisible()
    elif fate < 0.1:
        prim.SetActive(False)
    elif fate < 0.14:
        UsdGeom.Imageable(prim).CreatePurposeAttr(random.choice(["guide", "proxy", "render"]))
    return prim


def write_stage(path):
    """Writes a random stage."""
    layer = path.with_suffix(random.choice([".usda", ".usdc"])) if path.suffix == ".usdz" else path
    stage = Usd.Stage.CreateNew(str(layer))
    time = random.choice([0, 0, 1, 101])
    if random.random() < 0.6:
        UsdGeom.SetStageUpAxis(stage, random.choice("YZ"))
    if random.random() < 0.6:
        UsdGeom.SetStageMetersPerUnit(stage, random.choice([1, 0.01, 0.0254]))
    if time or random.random() < 0.5:
        stage.SetStartTimeCode(time)
    stage.GetRootLayer().comment = 'A "comment" with ) } ] and # in it'
    for k in range(random.randint(1, 3)):
        parent = ""
        for depth in range(random.randint(0, 3)):
            parent += f"/P{k}_{depth}"
            xform = UsdGeom.Xform.Define(stage, parent)
            add_operations(xform)
            if random.random() < 0.1:
                UsdGeom.Camera.Define(stage, parent + "/Camera")
            xform.GetPrim().SetCustomDataByKey("note", "}")
        add_splats(stage, f"{parent}/S{k}", time)
    if random.random() < 0.2:
        stage.CreateClassPrim("/Prototype")
        add_splats(stage, "/Prototype/S", time)
    if random.random() < 0.5:
        nested = {"copyright": "of another dictionary", "number": 1.5}
        data = {"creator": "usdzconvert", "copyright": '2026 "Museum" Łódź', "years": Vt.IntArray([1, 2]), "nested": nested}
        stage.GetRootLayer().customLayerData = data | random.choice([{}, {"zeros": 0.5, "license": "CC-BY-4.0"}])
    stage.GetRootLayer().Save()
    if layer != path and not UsdUtils.CreateNewUsdzPackage(str(layer), str(path)):
        raise RuntimeError(f"{path} was not written")


def fit(values, width, count, default):
    """Numbers of `count` elements: cut, or the default of OpenUSD for an array that is too short or missing."""
    flat = flatten(values)
    if len(flat) >= width * count:
        return flat[: width * count]
    return count * default


def flatten(values):
    """Numbers of an array; quaternions with the real part first."""
    found = []
    for value in values or []:
        if isinstance(value, (Gf.Quatf, Gf.Quath)):
            found += [value.GetReal(), *value.GetImaginary()]
        elif isinstance(value, (float, int)):
            found.append(value)
        else:
            found += list(value)
    return found


def read_stage(path):
    """Splats of a stage in its own coordinates, as usd-core evaluates them."""
    stage = Usd.Stage.Open(str(path))
    time = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() or stage.GetRootLayer().HasStartTimeCode() else None
    fields = []
    for prim in stage.Traverse():
        if prim.GetTypeName() != TYPE:
            continue
        imageable = UsdGeom.Imageable(prim)
        if imageable.ComputeVisibility() == "invisible" or imageable.ComputePurpose() in ("guide", "proxy"):
            continue

        def get(name, prim=prim):
            for suffix in ("", "h"):
                attribute = prim.GetAttribute(name + suffix)
                samples = attribute.GetTimeSamples()
                # The last sample until the first frame of the stage; values between samples are not blended.
                at = Usd.TimeCode.Default()
                if samples:
                    at = max([s for s in samples if time is not None and s <= time], default=samples[0])
                if attribute.HasAuthoredValue():
                    return attribute.Get(at)
            return None

        count = len(get("positions") or [])
        degree = prim.GetAttribute("radiance:sphericalHarmonicsDegree").Get()
        harmonics = flatten(get(HARMONICS))
        if len(harmonics) < 3 * count * (degree + 1) ** 2:
            degree, harmonics = 0, 3 * count * [0.0]
        matrix = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
        fields.append(
            {
                "path": str(prim.GetPath()),
                "count": count,
                "degree": degree,
                "matrix": [matrix[row][column] for row in range(4) for column in range(4)],
                "positions": flatten(get("positions")),
                "scales": fit(get("scales"), 3, count, [1, 1, 1]),
                "rotations": fit(get("orientations"), 4, count, [1, 0, 0, 0]),
                "opacities": fit(get("opacities"), 1, count, [1]),
                "sh": harmonics[: 3 * count * (degree + 1) ** 2],
                "order": prim.GetAttribute("sortingModeHint").Get(),
            }
        )
    data = stage.GetRootLayer().customLayerData
    return {
        "file": Path(path).name,
        "credits": [data.get("copyright"), data.get("license")],
        "up": UsdGeom.GetStageUpAxis(stage),
        "meters": UsdGeom.GetStageMetersPerUnit(stage) if UsdGeom.StageHasAuthoredMetersPerUnit(stage) else None,
        "fields": sorted(fields, key=lambda field: field["path"]),
    }


def faults_of(path):
    """Return the faults that the validators of usd-core find."""
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    return [error.GetMessage() for error in context.Validate(Usd.Stage.Open(str(path)))]


def dump_stage(path):
    """Write the arrays of the only prim as their bytes; quaternions with the real part last."""
    stage = Usd.Stage.Open(str(path))
    [prim] = [prim for prim in stage.Traverse() if prim.GetTypeName() == TYPE]
    for name in ARRAYS:
        path.with_suffix(f".{name.split(':')[-1]}").write_bytes(memoryview(prim.GetAttribute(name).Get()).tobytes())
    degree = prim.GetAttribute("radiance:sphericalHarmonicsDegree").Get()
    return {"file": path.name, "up": UsdGeom.GetStageUpAxis(stage), "degree": degree, "faults": faults_of(path)}


def main():
    """Run a command."""
    command, *rest = sys.argv[1:]
    if command == "write":
        folder, count, seed = Path(rest[0]), int(rest[1]), int(rest[2])
        random.seed(seed)
        paths = [folder / f"stage{k}.{['usda', 'usdc', 'usdz'][k % 3]}" for k in range(count)]
        for path in paths:
            write_stage(path)
        (folder / "expected.json").write_text(json.dumps([read_stage(path) for path in paths]))
    elif command == "dump":
        print(json.dumps([dump_stage(Path(path)) for path in rest]))
    else:
        found = []
        for path in map(Path, rest):
            found.append({**read_stage(path), "faults": faults_of(path)})
            stage = Usd.Stage.Open(str(path))
            for suffix in (".usda", ".usdc"):
                stage.GetRootLayer().Export(str(path.with_name(f"again-{path.stem}{suffix}")))
        print(json.dumps(found))


main()
