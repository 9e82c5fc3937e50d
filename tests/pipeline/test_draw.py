"""Drawings show every box and the kind on every edge."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from fogpipe.pipeline.draw import draw

TEXT = """
title: A <small> & "odd" graph
inputs: {image: Image, range_map: Range}
stages:
  filled: {use: toy.fill, in: {range_map: range_map}}
  parts: {use: toy.split, in: {range_map: filled}}
  t: {use: toy.transmission, in: {range_map: filled}}
  foggy: {use: toy.paint, in: {image: image, transmission: t}}
outputs: {foggy: foggy, far: parts.far}
"""


def test_svg_is_well_formed_and_names_every_stage_and_kind(build):
    root = ET.fromstring(draw(build(TEXT), "svg"))
    texts = [element.text for element in root.iter("{http://www.w3.org/2000/svg}text")]
    assert texts[0] == 'A <small> & "odd" graph'
    assert {"filled", "toy.fill", "parts", "t", "foggy", "image", "range_map", "far"} <= set(texts)
    assert {"Image", "Range [m]", "Transmission", "far: Mask"} <= set(texts)


def test_svg_boxes_of_one_layer_do_not_overlap(build):
    root = ET.fromstring(draw(build(TEXT), "svg"))
    boxes = [
        tuple(float(element.attrib[key]) for key in ("x", "y", "width", "height"))
        for element in root.iter("{http://www.w3.org/2000/svg}rect")
        if "rx" in element.attrib
    ]
    assert len(boxes) == 8
    for i, (x, y, width, height) in enumerate(boxes):
        for other_x, other_y, other_width, other_height in boxes[:i]:
            apart = (
                x + width <= other_x
                or other_x + other_width <= x
                or y + height <= other_y
                or other_y + other_height <= y
            )
            assert apart


def test_arrows_point_forwards(build):
    root = ET.fromstring(draw(build(TEXT), "svg"))
    for path in root.iter("{http://www.w3.org/2000/svg}path"):
        if "marker-end" in path.attrib:
            numbers = path.attrib["d"].replace("M", "").replace("C", "").replace("L", "").split()
            assert float(numbers[0]) < float(numbers[-2])


@pytest.mark.parametrize(
    ("form", "edge"), [("dot", '"parts" -> "out:far" [label="far: Mask"]'), ("mermaid", "far: Mask")]
)
def test_text_forms_hold_the_kinds(build, form, edge: str):
    text = draw(build(TEXT), form)
    assert edge in text
    assert text.count("->" if form == "dot" else "-->") == 7


def test_a_graph_without_stages_can_be_drawn(build):
    assert ET.fromstring(draw(build("inputs: {image: Image}\nstages: {}\noutputs: {image: image}"), "svg")) is not None
