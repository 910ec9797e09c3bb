"""Classes of scenarios, their events, and the thresholds of the rules that find them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum


class Label(IntEnum):
    """Class of a scenario."""

    UNKNOWN = 0
    FREE_CRUISE = 1
    CAR_FOLLOWING = 2
    CUT_IN = 3
    CUT_OUT = 4
    LANE_CHANGE_LEFT = 5
    LANE_CHANGE_RIGHT = 6
    RAMP_ENTERING = 7
    RAMP_EXITING = 8
    URBAN_CUT_IN = 9
    URBAN_CUT_OUT = 10
    ROUNDABOUT_ENTERING = 11
    ROUNDABOUT_EXITING = 12
    ROUNDABOUT_CIRCULATING = 13
    LEFT_TURN = 14
    RIGHT_TURN = 15
    STRAIGHT_CROSS = 16
    MERGING = 17

    @property
    def title(self) -> str:
        """Name as text."""
        return _TITLES[self]


_TITLES = {
    Label.UNKNOWN: "unknown",
    Label.FREE_CRUISE: "highway free cruise",
    Label.CAR_FOLLOWING: "highway car following",
    Label.CUT_IN: "highway cut in",
    Label.CUT_OUT: "highway cut out",
    Label.LANE_CHANGE_LEFT: "left lane change",
    Label.LANE_CHANGE_RIGHT: "right lane change",
    Label.RAMP_ENTERING: "ramp entering",
    Label.RAMP_EXITING: "ramp exiting",
    Label.URBAN_CUT_IN: "urban cut in",
    Label.URBAN_CUT_OUT: "urban cut out",
    Label.ROUNDABOUT_ENTERING: "roundabout entering",
    Label.ROUNDABOUT_EXITING: "roundabout exiting",
    Label.ROUNDABOUT_CIRCULATING: "roundabout circulating",
    Label.LEFT_TURN: "unsignalised left turn",
    Label.RIGHT_TURN: "unsignalised right turn",
    Label.STRAIGHT_CROSS: "unsignalised straight cross",
    Label.MERGING: "unsignalised merging",
}


@dataclass(frozen=True)
class LabelledEvent:
    """A scenario of a class.

    Attributes:
        recording: name of the recording.
        ego: name of the track that it is about.
        time: t*, the middle of its window, s.
        label: its class.
        partner: name of the other track that makes it one of its class, or None.
        tags: further criteria that hold or not, and measures at t* (m, s, m/s).
        why: conditions that hold, with values, and lanes of the map before and after, as text.
        severity: of its critical moment (`recognition.labels.critical`), from 0 to 1; None where it
            is not critical.
        critical: measures of that moment beyond their limits, as text.
        participants: names of the other tracks in it, the worst first.
    """

    recording: str
    ego: str
    time: float
    label: Label
    partner: str | None
    tags: dict[str, bool | float]
    why: str = ""
    severity: float | None = None
    critical: str = ""
    participants: tuple[str, ...] = ()


def counts(events: Iterable[LabelledEvent]) -> dict[Label, int]:
    """Number of events of each of the 17 classes, also of those without."""
    found = Counter(event.label for event in events)
    return {label: found[label] for label in Label if label is not Label.UNKNOWN}


@dataclass(frozen=True)
class Rules:
    """Thresholds of all rules. Times in s, lengths in m, speeds in m/s, accelerations in m/s²,
    angles in degrees.

    Attributes:
        window: length of the window about t*, for which ego has to be there without missing frames.
        margin, following_margin: time before and after the window in which free cruise, and
            following, hold too.
        spacing: least time between two free cruises, or two followings, of one ego.
        most_windows: most of each of them of one ego.
        gap: longest time without frames after which a track goes on.
        sight: how far ahead a lead is looked for.
        parked: least diagonal of the area in which a vehicle that drives moves, over its whole
            track; jitter has a speed, too.
        smoothing: time over which accelerations are averaged before they are compared.
        cruise_acceleration, cruise_speed_deviation: greatest |a| and standard deviation of the
            speed in free cruise.
        cruise_speed: least speed of free cruise: a vehicle standing in a jam is as steady.
        following_headway: greatest THW of following, and least of free cruise.
        queue_gap, queue_speed: a lead within this gap is followed at any headway of one moment, if
            the mean speed of the window and its margins is not less: in queues speeds change faster
            than gaps. The headway of the means counts.
        following_ttc: TTC below which following gets the tag `ttc_below_4s`.
        hold: how long a lane is held before and after a change; shorter stays in a lane are none.
        flicker: stays in a role shorter than this are none: where lanes of a junction overlap, rows
            jump between them.
        shift: least lateral displacement of a lane change, in lane widths.
        width: widest lane (m) of which shares count: a wider one is no further to cross.
        strict_shift: least lateral displacement in m, instead, where it is given.
        depth: least way that a vehicle gets beyond the border in a change of lane: on a border,
            places jitter.
        partial_hold, partial_shift: time for which the first or last lane of a track is held, and
            least lateral displacement (in lane widths), of a lane change that was recorded in part;
            it gets the tag `partial`.
        partial_urban_shift: the same on roads that are no motorways, where vehicles set off and
            turn at the edges of the view.
        partial_ramp: least way along a ramp on which the track begins or ends; such an event gets
            the tag `partial`, too.
        oblique: greatest angle between vehicle and lane where a lane change crosses the border; at
            more it leaves the road.
        turning, turning_time: greatest change of heading, beyond the road's own, so long before and
            after that; more is a turn.
        shift_time: time before and after a change in which the displacement is measured.
        cut_gap, cut_speed: greatest gap to a vehicle that cuts in or out, and least speed of both:
            standing vehicles do not.
        lateral_gap: lateral gap below which a cut-in gets the tag `lateral_gap_below_2m`.
        braking: acceleration below which a cut-out gets the tag `ego_brakes`.
        reaction: time after a cut-in or cut-out in which TTC or acceleration are looked at; before
            and after, ego does not change lane for so long.
        urban_ttc: TTC below which an urban cut-in gets the tag `ttc_below_3s`.
        urban_speed_limit: greatest speed limit of an urban lane.
        ramp_length: way along the ramp.
        ramp_shift: least lateral shift between ramp and main lane.
        yield_speed, yield_time: a vehicle that was slower, or has a lower PET, gets the tag
            `yields`.
        ring_spacing: least time between two events of circulating.
        passage: least way through a junction that counts; half of it for a turn.
        turn: least and greatest change of heading of a turn.
        partial_turn: least part of a turn that is recorded where the track begins or ends inside.
        beside: time within which a vehicle is on no lane, after it leaves its lane obliquely or
            before it enters one so.
        parking: a vehicle that stands beside its lane, and gets no further from it, parks: it does
            not turn.
        straight: greatest change of heading of a straight cross; less than that of a turn where no
            other way is straighter.
        opposing_time: time within which an opposing vehicle passes.
        vru_pet: PET with pedestrians and cyclists below which there is a conflict.
        merging_gap: arrivals in one lane less than this apart are merging.
        signalised: whether junctions with traffic lights count as well.
    """

    window: float = 1.5
    margin: float = 2.0
    following_margin: float = 0.75
    spacing: float = 6.0
    most_windows: int = 3
    gap: float = 0.5
    sight: float = 200.0
    parked: float = 2.0
    smoothing: float = 1.0
    cruise_acceleration: float = 0.3
    cruise_speed_deviation: float = 0.5
    cruise_speed: float = 5.0
    following_headway: float = 4.0
    queue_gap: float = 10.0
    queue_speed: float = 1.0
    following_ttc: float = 4.0
    hold: float = 1.0
    flicker: float = 0.5
    shift: float = 0.8
    width: float = 3.75
    strict_shift: float | None = None
    depth: float = 0.2
    partial_hold: float = 0.2
    partial_shift: float = 0.2
    partial_urban_shift: float = 0.5
    partial_ramp: float = 10.0
    oblique: float = 25.0
    turning: float = 20.0
    turning_time: float = 2.0
    shift_time: float = 4.0
    cut_gap: float = 80.0
    cut_speed: float = 0.5
    lateral_gap: float = 2.0
    braking: float = -1.0
    reaction: float = 2.0
    urban_ttc: float = 3.0
    urban_speed_limit: float = 70.0 / 3.6
    ramp_length: float = 50.0
    ramp_shift: float = 3.0
    yield_speed: float = 2.0
    yield_time: float = 3.0
    ring_spacing: float = 3.0
    passage: float = 5.0
    turn: tuple[float, float] = (45.0, 135.0)
    partial_turn: float = 28.0
    beside: float = 3.0
    parking: float = 10.0
    straight: float = 20.0
    opposing_time: float = 5.0
    vru_pet: float = 3.0
    merging_gap: float = 3.0
    signalised: bool = False


CONDITIONS = {
    Label.FREE_CRUISE: (
        "one main lane, |a| < {cruise_acceleration:g} m/s², no lead within THW "
        "{following_headway:g} s"
    ),
    Label.CAR_FOLLOWING: (
        "one main lane or ramp, one lead within THW {following_headway:g} s or {queue_gap:g} m"
    ),
    Label.CUT_IN: (
        "main lane is kept, partner changes into it and becomes the lead within {cut_gap:g} m"
    ),
    Label.CUT_OUT: "main lane is kept, partner is the lead within {cut_gap:g} m and leaves it",
    Label.LANE_CHANGE_LEFT: "changes to the lane on the left and holds it",
    Label.LANE_CHANGE_RIGHT: "changes to the lane on the right and holds it",
    Label.RAMP_ENTERING: "changes from a ramp to a main lane",
    Label.RAMP_EXITING: "changes from a main lane to a ramp",
    Label.URBAN_CUT_IN: (
        "lane is kept, partner changes into it, becomes the lead within {cut_gap:g} m"
    ),
    Label.URBAN_CUT_OUT: "lane is kept, partner is the lead within {cut_gap:g} m and leaves it",
    Label.ROUNDABOUT_ENTERING: "passes from an entry lane to the ring",
    Label.ROUNDABOUT_EXITING: "passes from the ring to an exit lane",
    Label.ROUNDABOUT_CIRCULATING: "stays in the ring through the window",
    Label.LEFT_TURN: (
        "turns left through a junction, or off or onto the road, by {turn[0]:g} "
        "to {turn[1]:g} degrees"
    ),
    Label.RIGHT_TURN: (
        "turns right through a junction, or off or onto the road, by {turn[0]:g} "
        "to {turn[1]:g} degrees"
    ),
    Label.STRAIGHT_CROSS: (
        "crosses another used way in a junction, turns by less than {straight:g} "
        "degrees or as the road"
    ),
    Label.MERGING: (
        "another vehicle from another road arrives in the same lane within {merging_gap:g} s"
    ),
}
"""Conditions of each class in words, with the thresholds of `Rules` in place."""
