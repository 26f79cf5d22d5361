"""Writes arms in MJCF that mix what the format can say, every figure drawn from a seed."""

from __future__ import annotations

from itertools import count
from pathlib import Path

import mujoco
import numpy as np

WEDGE = "0 0 0  0.1 0 0  0 0.2 0  0 0 0.3  0.1 0.2 0"  # no symmetry: a mirrored one is another


class Writer:
    """Writes one arm into a folder."""

    def __init__(self, folder: Path, features: str, seed: int) -> None:
        self.folder, self.features, self.rng = folder, set(features.split()), np.random.default_rng(seed)
        self.number = count()
        self.after = ""  # equality constraints
        self.keys: dict[str, float] = {}

    def has(self, *features: str) -> bool:
        return bool(self.features & set(features))

    def place(self, size: float = 0.3) -> str:
        return f'pos="{self.numbers(3, size)}" {self.turn()}'

    def numbers(self, n: int, size: float = 1.0) -> str:
        return " ".join(f"{x:.6f}" for x in self.rng.uniform(-size, size, n))

    def turn(self) -> str:
        """An orientation, in one of the ways this file uses."""
        ways = sorted(self.features & {"euler", "axisangle", "xyaxes", "zaxis"}) or ["quat"]
        way = ways[self.rng.integers(len(ways))]
        angle = 57.0 if self.has("degree") or not self.has("radian") else 1.0
        return {
            "quat": f'quat="{self.numbers(4)}"',
            "euler": f'euler="{self.numbers(3, angle)}"',
            "axisangle": f'axisangle="{self.numbers(3)} {angle * self.rng.uniform(-3, 3):.6f}"',
            "xyaxes": f'xyaxes="{self.numbers(6)}"',
            "zaxis": f'zaxis="{self.numbers(3)}"',
        }[way]

    def joint(self, name: str, kind: str = "hinge", extra: str = "") -> str:
        slide = kind == "slide"
        angle = 57.3 if not slide and not self.has("radian") else 1.0
        low, high = -angle * self.rng.uniform(0.5, 2.5), angle * self.rng.uniform(0.5, 2.5)
        text = f'type="{kind}" axis="{self.numbers(3)}"'
        if not self.has("unnamed"):
            text += f' name="{name}"'
        if not self.has("endless"):
            text += f' range="{low:.6f} {high:.6f}"'
        if self.has("ref"):
            text += f' ref="{self.rng.uniform(low, high):.6f}"'
        if self.has("anchor"):
            text += f' pos="{self.numbers(3, 0.2)}"'
        if self.has("classes") and not self.has("childclass"):
            text += ' class="arm"'
        return f"<joint {text} {extra}/>"

    def solid(self) -> str:
        if self.has("mesh"):
            return f'<geom type="mesh" mesh="wedge" {self.place()}/>'
        if self.has("fromto"):
            return f'<geom type="capsule" size="0.03" fromto="{self.numbers(6, 0.2)}"/>'
        kind = ("box", "capsule", "cylinder", "ellipsoid", "sphere")[self.rng.integers(5)]
        return f'<geom type="{kind}" size="0.05 0.06 0.07" {self.place()} group="{self.rng.integers(6)}"/>'

    def inertia(self) -> str:
        if self.has("fullinertia"):
            return '<inertial pos="0.01 0.02 0.03" mass="2" fullinertia="0.3 0.31 0.32 0.01 0.02 -0.01"/>'
        return (
            f'<inertial {self.place(0.1)} mass="1.5" diaginertia="0.02 0.03 0.025"/>' if self.rng.random() < 0.5 else ""
        )

    def site(self, name: str) -> str:
        if self.has("fromto"):
            return f'<site name="{name}" type="capsule" size="0.01" fromto="{self.numbers(6, 0.2)}"/>'
        return (
            f'<site name="{name}" class="posed"/>'
            if self.has("site_class")
            else f'<site name="{name}" {self.place()}/>'
        )

    def link(self, prefix: str, i: int, inside: str) -> str:
        """A body with what it moves by, what it is, and what it carries."""
        slides = {i == 3 and self.has("scara"), i == 2 and self.has("limited_slides")}
        kind = "slide" if any(slides) else "hinge"
        name = f"{prefix}j{i}"
        body = name if self.has("same_names") else f"{prefix}link{i}"
        joints = self.joint(name, kind)
        if self.has("double") and i % 2:
            joints += self.joint(f"{name}b", "slide" if i == 3 else "hinge")
        if (self.has("ball") and i == 2) or self.has("only_ball"):
            joints = f'<joint type="ball" name="{prefix}ball{i}"/>'
        site = self.site(body if self.has("site_same") and i == 2 else f"{prefix}site{i}")
        text = f'<body name="{body}" {self.place()}>{joints}{self.inertia()}{self.solid()}{site}{inside}</body>'
        return f"<frame {self.place()}>{text}</frame>" if self.has("frame") else text

    def arm(self, prefix: str = "") -> str:
        inside = f'<geom size="0.03"/>{self.site(prefix + "tip")}{self.grip(prefix)}'
        text = f'<body name="{prefix}hand" {self.place()}>{inside}</body>'
        for i in range(4, 0, -1):
            text = self.link(prefix, i, text)
        if self.has("coupled"):
            self.after += '<joint joint1="j2" joint2="j1" polycoef="0 -1 0 0 0"/>'
        if self.has("locked"):
            self.after += '<joint joint1="j2" polycoef="0.2 0 0 0 0"/>'
        if self.has("loop"):
            self.after += '<connect body1="link3" body2="link1" anchor="0 0 0.1"/>'
        if self.has("rail"):
            text = f'<body name="carriage" {self.place()}>{self.joint("rail", "slide")}<geom size="0.1"/>{text}</body>'
        free = "<freejoint/>" if self.has("free_base") else ""
        more = '<replicate count="3" offset="0 0.1 0"><geom type="box" size="0.02 0.01 0.01"/></replicate>'
        pose = self.place(1.0) if self.has("root_pose", "two_arms") else ""
        childclass = 'childclass="arm"' if self.has("childclass") else ""
        inside = f'{free}<geom size="0.1"/>{more if self.has("replicate") else ""}{self.site(prefix + "mount")}{text}'
        return f'<body name="{prefix}base" {pose} {childclass}>{inside}</body>'

    def grip(self, prefix: str) -> str:
        if self.has("gripper"):
            slide = '<joint name="{0}" type="slide" axis="0 1 0" range="0 0.04"/>'
            finger = f'<body name="{{0}}" {{1}}>{slide}<geom size="0.01"/></body>'
            names = [f"{prefix}{side}_finger" for side in ("left", "right")]
            self.after += f'<joint joint1="{names[0]}" joint2="{names[1]}"/>'
            return "".join(finger.format(name, self.place(0.05)) for name in names)
        if self.has("loop_gripper"):
            bar = '<body name="{0}" {1}><joint axis="0 1 0"/><geom size="0.01"/>{2}</body>'
            self.after += '<connect body1="pad" body2="spring" anchor="0 0 0.01"/>'
            crank = bar.format("crank", self.place(0.05), bar.format("pad", self.place(0.05), ""))
            return crank + bar.format("spring", self.place(0.05), "")
        return ""

    def write(self) -> Path:
        world = self.arm("left/") + self.arm("right/") if self.has("two_arms") else self.arm()
        if self.has("object"):
            world += '<body name="cup" pos="1 0 0"><freejoint/><geom size="0.1"/><site name="handle"/></body>'
        if self.has("mocap"):
            world += (
                '<body name="target" mocap="true" pos="0 1 0"><geom size="0.1" contype="0" conaffinity="0"/></body>'
            )
        if self.has("world_geom"):
            world += '<geom type="plane" size="9 9 1"/><geom type="box" size="0.2 0.3 0.1"/><site name="corner"/>'
        if self.has("include"):
            world = self.file(world)
        if self.has("deep"):
            world = self.file(world)
        asset = ""
        if self.has("mesh"):
            scale = "0.5 -0.4 0.3" if self.has("mirror") else "0.5 0.4 0.3"
            asset += f'<mesh name="wedge" vertex="{WEDGE}" scale="{scale}"/>'
        if self.has("attach"):
            (self.folder / "other.xml").write_text(
                f"<mujoco><worldbody>{Writer(self.folder, '', 7).arm()}</worldbody></mujoco>"
            )
            asset += '<model name="other" file="other.xml"/>'
            world += f'<body name="stand" {self.place()}><attach model="other" body="base" prefix="other/"/></body>'
        angle = "radian" if self.has("radian") else "degree"
        seq = 'eulerseq="ZyX"' if self.has("eulerseq") else ""
        compiler = f'<compiler angle="{angle}" {seq} autolimits="true"/>'
        joint = '<joint damping="2" armature="0.1" frictionloss="0.2"/><site size="0.02"/>'
        inner = '<default class="arm"><joint armature="0.3"/>{}</default>'
        inner = inner.format('<default class="wrist"><joint damping="1"/></default>' if self.has("nested") else "")
        posed = f'<default class="posed"><site {self.place()}/></default>'
        default = (
            f"<default>{joint}{inner if self.has('classes') else ''}{posed if self.has('site_class') else ''}</default>"
        )
        parts = [compiler, default, f"<asset>{asset}</asset>", f"<worldbody>{world}</worldbody>"]
        if self.has("late"):
            parts = parts[::-1]
        parts.append(f"<equality>{self.after}</equality>")
        path = self.folder / "arm.xml"
        path.write_text(f'<mujoco model="arm">{"".join(parts)}</mujoco>')
        if self.has("key"):
            model = mujoco.MjModel.from_xml_path(str(path))
            low, high = model.jnt_range.T
            self.keys = {model.joint(j).name: low[j] + 0.3 * (high[j] - low[j]) for j in range(model.njnt)}
            qpos = " ".join(f"{value!r}" for value in map(float, self.keys.values()))
            parts.append(f'<keyframe><key name="home" qpos="{qpos}"/></keyframe>')
            path.write_text(f'<mujoco model="arm">{"".join(parts)}</mujoco>')
        return path

    def file(self, text: str) -> str:
        name = f"part{next(self.number)}.xml"
        (self.folder / name).write_text(f"<mujocoinclude>{text}</mujocoinclude>")
        return f'<include file="{name}"/>'
