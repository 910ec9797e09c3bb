"""Thresholds of the labelling rules, with the defaults of METHOD.md."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rules:
    """Everything that a rule compares with. Times in s, lengths in m, speeds in m/s, accelerations in m/s², angles in degrees.

    Attributes:
        window: length of the window about t*, for which ego has to be there without missing frames.
        margin: time before and after the window in which free cruise and following hold too.
        spacing: least time between two free cruises, or two followings, of one ego.
        most_windows: most of each of them of one ego.
        sight: how far ahead a lead is looked for.
        smoothing: time over which accelerations are averaged before they are compared.
        cruise_acceleration, cruise_speed_deviation: greatest |a| and standard deviation of the speed in free cruise.
        cruise_speed: least speed of free cruise: who stands in a jam is as steady.
        following_headway: greatest THW of following, and least of free cruise.
        following_ttc: TTC below which following gets the tag `ttc_below_4s`.
        hold: how long a lane is held before and after a change; shorter stays in a lane are none.
        flicker: stays in a role shorter than this are none: where lanes of a junction overlap, rows jump between them.
        shift: least lateral displacement of a lane change, in lane widths.
        strict_shift: least lateral displacement in m, instead, where it is given.
        partial_hold, partial_shift: time for which the first or last lane of a track is held, and least lateral displacement (in
            lane widths), of a lane change that was recorded in part; it gets the tag `partial`.
        partial_urban_shift: the same on roads that are no motorways, where vehicles set off and turn at the edges of the view.
        partial_ramp: least way along a ramp on which the track begins or ends; such an event gets the tag `partial`, too.
        oblique: greatest angle between vehicle and lane where a lane change crosses the border.
        turning, turning_time: greatest change of heading, beyond the road's own, so long before and after that; more is a turn.
        shift_time: time before and after a change in which the displacement is measured.
        cut_gap, cut_speed: greatest gap to who cuts in or out, and least speed of ego then: nobody is in the way of who stands.
        lateral_gap: lateral gap below which a cut-in gets the tag `lateral_gap_below_2m`.
        braking: acceleration below which a cut-out gets the tag `ego_brakes`.
        reaction: time after a cut-in or cut-out in which TTC or acceleration are looked at; before and after, ego does not change
            lane for so long.
        urban_ttc: TTC below which an urban cut-in has to be.
        urban_speed_limit: greatest speed limit of an urban lane.
        ramp_length: way along the ramp.
        ramp_shift: least lateral shift between ramp and main lane.
        yield_speed, yield_time: who was slower, or has a lower PET, gets the tag `yields`.
        ring_spacing: least time between two events of circulating.
        passage: least way through a junction that counts.
        turn: least and greatest change of heading of a turn.
        straight: greatest change of heading of a straight cross.
        opposing_time: time within which an opposing vehicle passes.
        vru_pet: PET with pedestrians and cyclists below which there is a conflict.
        merging_gap: arrivals in one lane less than this apart are merging.
        signalised: whether junctions with traffic lights count as well.
    """

    window: float = 1.5
    margin: float = 2.0
    spacing: float = 6.0
    most_windows: int = 3
    sight: float = 200.0
    smoothing: float = 1.0
    cruise_acceleration: float = 0.3
    cruise_speed_deviation: float = 0.5
    cruise_speed: float = 5.0
    following_headway: float = 4.0
    following_ttc: float = 4.0
    hold: float = 1.0
    flicker: float = 0.5
    shift: float = 0.8
    strict_shift: float | None = None
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
    straight: float = 20.0
    opposing_time: float = 5.0
    vru_pet: float = 3.0
    merging_gap: float = 3.0
    signalised: bool = False
