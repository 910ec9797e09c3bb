"""Event logs as rows of bars."""

from __future__ import annotations

from runner.recording import LogEntry, signal_states
from runner.view.replay.account import is_shown, rows

EVENT = "story::act::group::maneuver::event"
LOG = [
    LogEntry(0.0, "startTransition", "Init::Ego::SpeedAction", ""),
    LogEntry(0.0, "endTransition", "Init::Ego::SpeedAction", ""),
    LogEntry(0.0, "startTransition", "Init::Lead::SpeedAction", ""),
    LogEntry(0.0, "startTransition", "story", ""),
    LogEntry(0.0, "startTransition", "story::act", "with its story"),
    LogEntry(1.0, "startTransition", EVENT, "near: 4 m < 5 m"),
    LogEntry(1.0, "startTransition", f"{EVENT}::action", ""),
    LogEntry(1.5, "interventionStart", "Ego", "too near"),
    LogEntry(2.0, "collision", "Ego", "touches no longer touches you"),
    LogEntry(2.5, "collisionEnd", "Ego", "no longer touches no longer touches you"),
    LogEntry(3.0, "endTransition", f"{EVENT}::action", ""),
    LogEntry(3.0, "endTransition", EVENT, ""),
    LogEntry(4.0, "startTransition", EVENT, "near: 3 m < 5 m"),
    LogEntry(5.0, "stopTransition", EVENT, "overridden"),
    LogEntry(5.0, "trafficSignal", "7", "red"),
    LogEntry(6.0, "endTransition", "Init::Lead::SpeedAction", ""),
]
ACTORS = {"story::act::group": ("Lead", "Ego")}
NAMES = ("Ego", "Lead", "no longer touches you")


def test_each_thing_has_its_row_with_a_bar_for_each_time() -> None:
    found = {(row.level, row.label): row.bars for row in rows(LOG, ACTORS, NAMES)}
    assert list(found) == [
        ("act", "act"),
        ("event", "event"),
        ("action", "SpeedAction"),
        ("action", "action"),
        ("intervention", "Ego"),
        ("collision", "Ego – no longer touches you"),
        ("note", "trafficSignal"),
    ]
    assert found["act", "act"] == [(0.0, None, "with its story")]
    assert found["event", "event"] == [(1.0, 3.0, "near: 4 m < 5 m"), (4.0, 5.0, "near: 3 m < 5 m")]
    assert found["action", "SpeedAction"] == [(0.0, 6.0, "")]
    assert found["intervention", "Ego"] == [(1.5, None, "too near")]
    assert found["note", "trafficSignal"] == [(5.0, 5.0, "red")]


def test_each_thing_names_the_participants_that_it_is_about() -> None:
    found = {(row.level, row.label): row.who for row in rows(LOG, ACTORS, NAMES)}
    assert found["act", "act"] == ()
    assert found["event", "event"] == found["action", "action"] == ("Lead", "Ego")
    assert found["action", "SpeedAction"] == ("Lead",)
    assert found["intervention", "Ego"] == ("Ego",)
    assert found["collision", "Ego – no longer touches you"] == ("Ego", "no longer touches you")
    assert found["note", "trafficSignal"] == ()


def test_notes_of_two_participants_are_two_rows() -> None:
    log = [
        LogEntry(float(time), "light", name, "on")
        for time, name in enumerate(("Ego", "Lead", "Ego", "lamp"))
    ]
    assert [(row.who, len(row.bars)) for row in rows(log, {}, NAMES)] == [
        (("Ego",), 2),
        (("Lead",), 1),
        ((), 1),
    ]


def test_the_list_leaves_the_storyboards_bookkeeping_out() -> None:
    shown = [entry.subject for entry in LOG if is_shown(entry)]
    assert "story" not in shown
    assert not any(subject.startswith("Init::") for subject in shown)
    assert shown.count("story::act") == 1
    assert len(shown) == 11


def test_signals_have_their_states() -> None:
    assert signal_states(LOG) == {"7": [(5.0, "red")]}
