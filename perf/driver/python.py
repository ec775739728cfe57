"""Python programs beside Python programs of others: bursts of 16 B and arrays of 1 MiB through a hub, a broker or a proxy, and how
long an import takes. `./dev perf --python` measures it and keeps it in docs/performance/python.json.

Each pair is started by perf/python_pair.py with the Python of the system, for which Debian has the libraries."""

import pathlib
import resource
import statistics
import subprocess
import tempfile
import textwrap

from driver.rows import shown
from driver.subjects import Mosquitto, SubjectError, TcpHub, allowed_cpus, child_setup, read_line

ROOT = pathlib.Path(__file__).resolve().parents[2]
FIGURES = ROOT / "docs" / "performance" / "python.json"
PACKAGES = ["mosquitto", "python3-paho-mqtt", "python3-zmq"]
PYTHON = "/usr/bin/python3"
ROUNDS = 5
IMPORTS = 20
PATIENCE_SECONDS = 120
BURST = (16, 20_000)  # bytes, messages
ARRAYS = (1 << 20, 200)
GOALS = (("rate of 16 B, times paho-mqtt", "burst", "paho", 6), ("rate of 16 B, times pyzmq", "burst", "pyzmq", 0.3),
         ("rate of 1 MiB, times pyzmq", "arrays", "pyzmq", 1))


def environment(build: pathlib.Path) -> dict[str, str]:
    return {"PYTHONPATH": str(ROOT / "python"), "GIMNET_LIBRARY": str((build / "lib" / "libgimnet.so.1").resolve()),
            "PATH": "/usr/bin:/bin", "PYTHONPYCACHEPREFIX": str(build.resolve() / "python")}


def run_pair(library: str, url: str, size: int, count: int, build: pathlib.Path) -> float:
    """Messages a second, of which none was lost."""
    command = [PYTHON, str(ROOT / "perf" / "python_pair.py"), library, url, str(size), str(count)]
    receiver = subprocess.Popen([*command, "receive"], env=environment(build), stdout=subprocess.PIPE, stdin=subprocess.DEVNULL,
                                preexec_fn=child_setup(allowed_cpus()))
    try:
        if read_line(receiver) is None:
            raise SubjectError(f"{library}: the receiving program was not ready")
        with subprocess.Popen([*command, "send"], env=environment(build), stdin=subprocess.DEVNULL) as sender:
            try:
                out, _ = receiver.communicate(timeout=PATIENCE_SECONDS)
            finally:
                sender.kill()
        if receiver.returncode != 0:
            raise SubjectError(f"{library}: the receiving program ended with {receiver.returncode}")
        return count / float(out)
    finally:
        receiver.kill()
        receiver.communicate()


def seconds_of(words: str, build: pathlib.Path) -> float:
    """Time of the processor, which other programs change less than the time that passes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([PYTHON, "-c", words], env=environment(build), check=True, timeout=PATIENCE_SECONDS)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def measure(build: pathlib.Path) -> dict:
    """Everybody takes turns."""
    rates: dict = {name: {"gimnet": [], "paho": [], "pyzmq": []} for name in ("burst", "arrays")}
    with TcpHub(build, allowed_cpus(), []) as hub, Mosquitto(build, allowed_cpus()) as broker, tempfile.TemporaryDirectory() as folder:
        proxy_url = f"ipc://{folder}/proxy"
        proxy = subprocess.Popen([PYTHON, str(ROOT / "perf" / "python_pair.py"), "pyzmq", proxy_url, "0", "0", "proxy"],
                                 env=environment(build), stdout=subprocess.PIPE, preexec_fn=child_setup(allowed_cpus()))
        try:
            if read_line(proxy) is None:
                raise SubjectError("pyzmq: the proxy was not ready")
            urls = {"gimnet": hub.urls["unix"], "paho": broker.urls["tcp"], "pyzmq": proxy_url}
            for _ in range(ROUNDS):
                for library, url in urls.items():
                    rates["burst"][library].append(run_pair(library, url, *BURST, build))
                    if library != "paho":
                        rates["arrays"][library].append(run_pair(library, url, *ARRAYS, build))
        finally:
            proxy.kill()
            proxy.communicate()
    del rates["arrays"]["paho"]
    times = {words: [seconds_of(words, build) for _ in range(IMPORTS)] for words in ("pass", "import gimnet")}
    return {"messages_per_second": rates, "import_ms": (statistics.median(times["import gimnet"]) - statistics.median(times["pass"])) * 1e3}


def describe(figures: dict) -> str:
    rates, machine = figures["messages_per_second"], figures["machine"]
    lines = []
    for title, kind, other, goal in GOALS:
        ratio = statistics.median(mine / theirs for mine, theirs in zip(rates[kind]["gimnet"], rates[kind][other], strict=True))
        lines.append(f"{title}: {shown(ratio)} (goal {goal}, {'met' if ratio >= goal else 'missed'})")
    lines.append(f"`import gimnet`: {figures['import_ms']:.0f} ms of a processor more than `pass` (goal 50)")
    lines += [f"messages a second, {title}: {', '.join(f'{name} {shown(statistics.median(of))}' for name, of in rates[kind].items())}"
              for title, kind in (("16 B", "burst"), ("1 MiB", "arrays"))]
    text = (f"{figures['date']}, {machine['processor']}, {machine['cpus_allowed']} processors, GIMnet {figures['version']}. "
            f"{'; '.join(lines)}.")
    return textwrap.fill(text, 100, break_long_words=False, break_on_hyphens=False)
