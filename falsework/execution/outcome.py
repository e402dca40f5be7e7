"""Outcome of a run: counts, paths, and a reason for every scene that is not complete."""

from dataclasses import dataclass, field, replace
from pathlib import Path


@dataclass
class Outcome:
    """Outcome of a run, or of one scene.

    Attributes:
        made: Number of results made in this run.
        reused: Number of results that existed.
        rejected: Scene name to the reason of its rejection.
        failed: Scene name to its error.
        reports: The report page of each finished scene.
        clouds: The cloud folder of each finished survey.
    """

    made: int = 0
    reused: int = 0
    rejected: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    reports: list[Path] = field(default_factory=list)
    clouds: list[Path] = field(default_factory=list)

    def below(self, out: Path, place: Path) -> "Outcome":
        """Replace the workers' path of the output folder by the user's.

        Args:
            out: The folder as the user names it.
            place: The folder as its workers name it.
        """
        reports, clouds = ([out / path.relative_to(place) for path in paths] for paths in (self.reports, self.clouds))
        return replace(self, reports=reports, clouds=clouds)

    def add(self, other: "Outcome") -> None:
        """Add the outcome of another part of the run.

        Args:
            other: Outcome of that part.
        """
        self.made += other.made
        self.reused += other.reused
        self.rejected = dict(sorted({**self.rejected, **other.rejected}.items()))
        self.failed = dict(sorted({**self.failed, **other.failed}.items()))
        self.reports = sorted([*self.reports, *other.reports])
        self.clouds = sorted([*self.clouds, *other.clouds])
