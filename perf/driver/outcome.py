"""What the runs of one case on one subject found."""

from dataclasses import dataclass, field

from driver.suite import Case


@dataclass
class Outcome:
    """What the runs of one case on one subject found, or why there is nothing."""

    subject: str
    case: Case
    findings: list[dict[str, float]] = field(default_factory=list)
    error: str | None = None
    is_absent: bool = False  # `error` says why it was not even tried
    rounds: list[int] = field(default_factory=list)  # of each finding: what has the same number can be compared

    def __post_init__(self) -> None:
        self.rounds = self.rounds or list(range(len(self.findings)))

    def add(self, number: int, found: dict[str, float]) -> None:
        self.rounds.append(number)
        self.findings.append(found)
