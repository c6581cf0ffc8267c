"""Hands in, effects out: scenes of objects, the hand that meets them, and the rules of touch, grasp, pattern and clutch."""

from __future__ import annotations

from haptics.scene.hand_files.load import load_hand, shipped_hands
from haptics.scene.hands.frame import HandFrame
from haptics.scene.hands.joints import JOINTS
from haptics.scene.hands.recording import HandRecording, HandTrack
from haptics.scene.library import load_scene, shipped_scenes
from haptics.scene.objects import SceneObject
from haptics.scene.scene import Scene, SceneNeeds
from haptics.scene.sites import SITES, SiteMap, nominal_sites

__all__ = [
    "JOINTS",
    "SITES",
    "HandFrame",
    "HandRecording",
    "HandTrack",
    "Scene",
    "SceneNeeds",
    "SceneObject",
    "SiteMap",
    "load_hand",
    "load_scene",
    "nominal_sites",
    "shipped_hands",
    "shipped_scenes",
]
