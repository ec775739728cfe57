"""Publisher, subscriber, adder and ask of examples/, whose every message is accounted for."""

import re
import signal
import subprocess
import threading
import time

from support.processes import BIN, Process
from support.waiting import wait_until

QUESTIONS_PER_S = 50
PROGRAMS = {"publisher": "giver", "adder": "giver", "subscriber": "taker", "ask": "taker"}
PRINTED = re.compile(rb"^(\S+) #(\d+): x (\d+\.\d+) y 0$", re.M)
ANSWERED = re.compile(rb"^(\d+) 1: (\d+)\.0+$", re.M)


class Everyday:
    """Publisher and adder at one hub, subscriber and ask at the same or another one. Each is there when it is made."""

    def __init__(self, test, giver, taker):
        self._test = test
        self._hubs = {"giver": giver, "taker": taker}
        self._running, self._ended = {}, []
        self._question = 0
        self._asking = threading.Event()
        self._asker = None
        for name in PROGRAMS:
            self._start(name)
        self._until_all_go_on()

    def _start(self, name):
        hub = self._hubs[PROGRAMS[name]]
        process = Process([BIN / "examples" / name], env={"GIMNET_HUB": hub.url}, stdin=subprocess.PIPE)
        self._test.addCleanup(process.end)
        self._running[name] = process
        if name == "ask":
            self._asking = threading.Event()
            self._asker = threading.Thread(target=self._ask, args=(process, self._asking), daemon=True)
            self._asker.start()

    def _ask(self, process, end):
        process.asked = []
        while not end.wait(1 / QUESTIONS_PER_S):
            self._question += 1
            try:
                process.popen.stdin.write(b"%d 1\n" % self._question)
                process.popen.stdin.flush()
            except BrokenPipeError:
                return
            process.asked.append(self._question)

    def _until_all_go_on(self):
        subscriber, ask = self._running["subscriber"], self._running["ask"]
        printed, answered = len(PRINTED.findall(subscriber.out)), len(ANSWERED.findall(ask.out))
        said = {name: process.err[-200:] for name, process in self._running.items()}
        wait_until(lambda: len(PRINTED.findall(subscriber.out)) >= printed + 3, f"messages; they said: {said}")
        wait_until(lambda: len(ANSWERED.findall(ask.out)) >= answered + 3, f"answers; they said: {said}")

    def kill_and_start_again(self, name):
        self._kill(name)
        self._start(name)
        self._until_all_go_on()

    def _kill(self, name):
        if name == "ask":
            self._asking.set()
            self._asker.join()
        process = self._running[name]
        process.signal(signal.SIGKILL)
        process.wait()
        self._ended.append((name, process))

    def kill_hub(self, which):
        hub = self._hubs[which]
        hub.process.signal(signal.SIGKILL)
        hub.process.wait()
        again = hub.again(self._test)
        self._hubs = {name: again if each is hub else each for name, each in self._hubs.items()}
        self._until_all_go_on()

    def stop_hub(self, which, seconds):
        hub = self._hubs[which].process
        hub.signal(signal.SIGSTOP)
        time.sleep(seconds)
        hub.signal(signal.SIGCONT)
        self._until_all_go_on()

    def cut(self, link):
        link.drop_all()
        self._until_all_go_on()

    def close(self):
        """Ends all; each step of the publisher and each question came to something."""
        self._asking.set()
        self._asker.join()
        ask = self._running["ask"]
        ask.popen.stdin.close()
        ask.wait()
        for name in ("publisher", "subscriber", "adder"):
            self._kill(name)
        self._ended.append(("ask", ask))
        for name, process in self._ended:
            if name == "ask":
                self._look_at_questions(process, process is ask)
            elif name == "subscriber":
                self._look_at_steps(process)

    def _look_at_questions(self, ask, to_the_end):
        """Each has its answer, or a sentence that says why not; one that was killed leaves the last ones open."""
        for number, answer in ANSWERED.findall(ask.out):
            self._test.assertEqual(int(answer), int(number) + 1)
        answered = [int(number) for number, _ in ANSWERED.findall(ask.out)]
        refused = [int(number) for number in re.findall(r"^ask: (\d+) 1: .", ask.err, re.M)]
        ended = sorted(answered + refused)
        self._test.assertEqual(ended, ask.asked if to_the_end else ask.asked[:len(ended)], ask.err)

    def _look_at_steps(self, subscriber):
        """No step came twice. One that did not come is a gap in the numbers that the subscriber shows, or its publisher was told."""
        missing = gaps = 0
        last = None
        for _, number, x in PRINTED.findall(subscriber.out):
            now = int(number), round(float(x) * 10)
            if last and now[1] <= last[1]:  # a publisher that was started again
                last = 0, -1
            if last:
                self._test.assertGreater(now[0], last[0], subscriber.out)
                gaps += now[0] - last[0] - 1
                missing += now[1] - last[1] - 1
            last = now
        told = sum(process.err.count("publisher: ") for name, process in self._ended if name == "publisher")
        self._test.assertLessEqual(missing, gaps + told, subscriber.out.decode())
