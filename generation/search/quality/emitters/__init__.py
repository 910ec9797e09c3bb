"""What proposes points: each module here is an emitter by its name, a class `Emitter`."""
