"""Layers of lanes: which lanes are in force where a road has temporary ones, and lane sections cut into shorter ones.

A road has permanent lanes all along, and may have temporary ones in places (OpenDRIVE 1.9). Temporary lanes take precedence for
driving. A side of the road without temporary lanes keeps its permanent ones, but for those that temporary lanes cover.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from xodr.model import NO_WIDTH, Lane, LaneRef, LaneSection
from xodr.profiles import exceeding

NEAR = 1e-3
"""A border of lane sections so near [m] is taken for the place."""


class Stretch(NamedTuple):
    """A section of the temporary layer, and the s up to which its lanes hold on the left and on the right side of the road."""

    section: LaneSection
    left_end: float
    right_end: float


class _Piece(NamedTuple):
    """A section in force, and the section of the file that each of its lanes is from."""

    section: LaneSection
    sources: dict[int, LaneSection]


def in_force(permanent: Sequence[LaneSection], temporary: Sequence[Stretch]) -> list[LaneSection]:
    """The lane sections in force on a road: temporary lanes where there are some, with links to the lanes around them."""
    stretches = [Stretch(each.section, *(_snapped(permanent, end) for end in each[1:])) for each in temporary]
    starts = {_snapped(permanent, each.section.s) for each in stretches}
    borders = sorted({permanent[0].s, permanent[-1].end, *starts, *(end for each in stretches for end in each[1:])})
    pieces = [piece for start, end in pairwise(borders) for piece in _pieces(permanent, stretches, start, end)]
    for before, after in pairwise(pieces):
        for lane in before.section.lanes.values():
            back = {other.id: other.predecessors for other in after.section.lanes.values()}
            lane.successor = _linked(lane, lane.successors, back, before, after)
        for lane in after.section.lanes.values():
            back = {other.id: other.successors for other in before.section.lanes.values()}
            lane.predecessor = _linked(lane, lane.predecessors, back, after, before)
    return [piece.section for piece in pieces]


def _snapped(permanent: Sequence[LaneSection], s: float) -> float:
    border = min((permanent[0].s, *(section.end for section in permanent)), key=lambda each: abs(each - s))
    return border if abs(border - s) <= NEAR else s


def _pieces(permanent: Sequence[LaneSection], temporary: Sequence[Stretch], start: float, end: float) -> Iterator[_Piece]:
    """The sections in force between two neighbouring borders of the temporary layer."""
    holding = [each.section for each in temporary if each.section.left and each.section.s - NEAR <= start < each.left_end]
    left = holding[-1] if holding else None
    holding = [each.section for each in temporary if each.section.right and each.section.s - NEAR <= start < each.right_end]
    right = holding[-1] if holding else None
    if left and right:
        yield _joined(start, end, right, ((left, left.left), (right, right.right)))
        return
    for usual in permanent:
        low, high = max(start, usual.s), min(end, usual.end)
        if low >= high:
            continue
        if left:
            yield _joined(low, high, left, ((left, left.left), (usual, _free(usual.right, usual, left, low, high))))
        elif right:
            yield _joined(low, high, right, ((usual, _free(usual.left, usual, right, low, high)), (right, right.right)))
        else:
            yield _joined(low, high, usual, ((usual, usual.left), (usual, usual.right)))


def _free(side: Sequence[int], usual: LaneSection, other: LaneSection, low: float, high: float) -> list[int]:
    """The permanent lanes of one side whose centre no temporary lane of the other side lies on."""
    s = 0.5 * (low + high)
    covered = [sorted((lane.inner(s), lane.outer(s))) for lane in other.lanes.values() if lane.id]
    centres = {lane_id: usual.lanes[lane_id].center(s) for lane_id in side}
    return [lane_id for lane_id in side if not any(inner < centres[lane_id] < outer for inner, outer in covered)]


def _joined(start: float, end: float, middle: LaneSection, sides: Sequence[tuple[LaneSection, Sequence[int]]]) -> _Piece:
    """A section made of the centre lane of one section and lanes of others."""
    sources = {0: middle, **{lane_id: section for section, ids in sides for lane_id in ids}}
    lanes = {lane_id: cut(section.lanes[lane_id], start, end) for lane_id, section in sources.items()}
    return _Piece(LaneSection(start, end, lanes), sources)


def _linked(
    lane: Lane, declared: Sequence[LaneRef], back: Mapping[int, Sequence[LaneRef]], here: _Piece, there: _Piece
) -> int | None:
    """The lane of a neighbouring section that continues a lane: itself, where only the other side of the road changes.

    back: the links of the neighbouring section's lanes, for links that only one of two lanes declares.
    """
    if not lane.id or here.sources[lane.id] is there.sources.get(lane.id):
        return lane.id or None
    found = [link.id for link in declared if has(there.section, link)]
    return next(iter(found or [other for other, links in back.items() if LaneRef(lane.id, lane.layer) in links]), None)


def has(section: LaneSection, link: LaneRef) -> bool:
    """Whether the lane that a link names is one of a section."""
    lane = section.lanes.get(link.id)
    return lane is not None and lane.layer == link.layer


def cut(lane: Lane, start: float, end: float) -> Lane:
    """A lane between two s, with the marks that hold there."""
    opens, closes = exceeding(lane.width, NO_WIDTH, start, end) if lane.id else (lane.opens, lane.closes)
    before, marks = [mark for mark in lane.marks if mark.s < start], [mark for mark in lane.marks if start <= mark.s < end]
    if before and not (marks and marks[0].s == start):
        marks.insert(0, before[-1]._replace(s=start))
    return replace(lane, opens=opens, closes=closes, marks=tuple(marks))
