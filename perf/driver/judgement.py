"""What is wrong with runs, whatever they measured: whether everything arrived as it was sent, and the ledger explains the rest."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    is_error: bool  # otherwise it is only said
    sentence: str

    def __str__(self) -> str:
        return f"{'error' if self.is_error else 'warning'}: {self.sentence}"


def faults_of(where: str, counted: dict[str, float], is_ours: bool = True, is_smoke: bool = False) -> list[Fault]:
    """`counted` are the sums of runs. What other hubs do is said, but is not our failure; what is lost is one in a smoke run only."""
    faults = []
    if counted.get("wrong"):
        faults.append(Fault(is_ours or is_smoke, f"{where}: {counted['wrong']:.0f} messages arrived that were not sent so"))
    if counted.get("ledger_gap"):
        faults.append(Fault(True, f"{where}: the hub's ledger does not explain {counted['ledger_gap']:.0f} frames"))
    if counted.get("lost"):
        faults.append(Fault(is_ours and is_smoke, f"{where}: {counted['lost']:.0f} messages were lost"))
    return faults
