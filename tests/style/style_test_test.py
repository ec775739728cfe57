#!/usr/bin/env python3
"""Each rule finds a violation planted for it and lets the nearest innocent code pass: a rule that cannot fail is none."""

import tempfile
import unittest
from pathlib import Path

import rules
from tree import Tree

GUARDED = "#pragma once\n"


def long_function(lines, head="int f(int a) {"):
    return head + "\n" + "  a();\n" * (lines - 2) + "}\n"


def planted_table(program, find):
    return (f'[[bug]]\nname = "A"\nbreaks = "b"\nprogram = "{program}"\n'
            f'[[bug.edit]]\nfile = "src/a.cpp"\nfind = "{find}"\nreplace = "c"\n')


# rule: (innocent trees, trees with exactly one violation); a tree is {path: text}.
CASES = {
    rules.include_arrows: (
        [
            {"src/proto/frame/a.cpp": '#include "base/ids.hpp"\n#include <vector>\n'},
            {"src/hub/data/a.cpp": '#include "hub/limits.hpp"\n#include "hub/concurrent/waker.hpp"\n'},
            {"src/hub/control/conductor.cpp": '#include "hub/control/state/names.hpp"\n#include "hub/shard/a.hpp"\n'},
            {"src/hub/control/state/names.cpp": '#include "proto/control/ns.hpp"\n#include "hub/limits.hpp"\n'},
            {"src/hub/control/listener.hpp": '#include "hub/version.hpp"\n#include "hub/observe/names.hpp"\n'},
            {"src/hub/config/options.hpp": '#include "hub/control/listen_url.hpp"\n'},
            {"src/hub/data/egress/a.hpp": '#include "net/stream.hpp"\n'},
            {"src/hub/main.cpp": '#include "hub/control/conductor.hpp"\n'},
            {"src/client/gimi/a.cpp": '#include "client/nif/a.hpp"\n#include "gimnet/nif.h"\n'},
            {"src/tools/a.cpp": '#include "client/gimi/node.hpp"\n#include <CLI/CLI.hpp>\n'},
            {"examples/a.cpp": '#include <gimnet/gimi.hpp>\n#include "local.hpp"\n'},
            {"include/gimnet/gimi.hpp": '#include "gimnet/nif.h"\n'},
        ],
        [
            {"src/base/a.cpp": '#include "proto/frame/a.hpp"\n'},
            {"src/proto/a.cpp": '#include "hub/limits.hpp"\n'},
            {"src/proto/a.cpp": '#include "gimnet/nif.h"\n'},
            {"src/hub/concurrent/a.hpp": '#include "hub/data/a.hpp"\n'},
            {"src/hub/data/a.cpp": '#include "hub/shard/commands.hpp"\n'},
            {"src/hub/data/a.cpp": '#include "hub/observe/web.hpp"\n'},
            {"src/hub/data/a.cpp": '#include "net/socket_stream.hpp"\n'},
            {"src/hub/control/a.cpp": '#include "hub/config/options.hpp"\n'},
            {"src/hub/config/a.cpp": '#include "hub/hub.hpp"\n'},
            {"src/hub/shard/a.cpp": '#include "hub/control/conductor.hpp"\n'},
            {"src/hub/control/state/a.cpp": '#include "hub/control/conductor.hpp"\n'},
            {"src/hub/control/state/a.cpp": '#include "hub/concurrent/waker.hpp"\n'},
            {"src/hub/main.cpp": '#include "client/nif/a.hpp"\n'},
            {"src/hub/main.cpp": "#include <gimnet/nif.h>\n"},
            {"src/client/nif/a.cpp": '#include "hub/limits.hpp"\n'},
            {"src/client/nif/a.cpp": '#include "client/gimi/node.hpp"\n'},
            {"src/tools/a.cpp": '#include "hub/limits.hpp"\n'},
            {"src/newpart/a.cpp": "int a;\n"},
            {"include/gimnet/unplaced.h": "int a;\n"},
        ],
    ),
    rules.forbidden_includes: (
        [
            {"src/proto/a.cpp": "#include <vector>\n#include <functional>\n"},
            {"src/client/nif/a.cpp": "#include <mutex>\n#include <sys/socket.h>\n"},
            {"src/hub/data/a.cpp": "#include <atomic>\n#include <memory>\n"},
            {"src/hub/control/a.cpp": "#include <boost/asio.hpp>\n"},
        ],
        [
            {"src/proto/a.cpp": "#include <sys/socket.h>\n"},
            {"src/proto/a.cpp": "#include <netinet/in.h>\n"},
            {"src/proto/a.cpp": "#include <thread>\n"},
            {"src/proto/a.cpp": "#  include <mutex>\n"},
            {"src/proto/a.cpp": "#include <atomic>\n"},
            {"src/proto/a.cpp": "#include <boost/endian.hpp>\n"},
            {"include/gimnet/bitestream.h": "#include <pthread.h>\n"},
            {"src/base/a.hpp": "#include <boost/assert.hpp>\n"},
            {"src/client/gimi/a.cpp": "#include <boost/asio.hpp>\n"},
            {"src/client/gimi/a.cpp": "#include <fmt/format.h>\n"},
            {"src/hub/data/a.cpp": "#include <mutex>\n"},
            {"src/hub/data/a.cpp": "#include <shared_mutex>\n"},
            {"src/hub/data/a.cpp": "#include <functional>\n"},
            {"src/hub/control/state/a.cpp": "#include <thread>\n"},
            {"src/hub/control/state/a.cpp": "#include <boost/asio/post.hpp>\n"},
        ],
    ),
    rules.no_shared_pointers_in_the_data_plane: (
        [{"src/hub/data/a.hpp": "std::unique_ptr<int> a;  // no shared_ptr\n"}, {"src/hub/a.hpp": "std::shared_ptr<int> a;\n"}],
        [{"src/hub/data/a.hpp": "std::shared_ptr<int> a;\n"}, {"src/hub/data/a.cpp": "auto a = std::make_shared<int>();\n"}],
    ),
    rules.includes_from_src: (
        [{"src/base/a.cpp": '#include "base/a.hpp"\n'}],
        [{"src/base/a.cpp": '#include "../base/a.hpp"\n'}, {"tests/base/a_test.cpp": '#include "base/../a.hpp"\n'}],
    ),
    rules.own_header_first: (
        [
            {"src/base/a.cpp": '// About.\n#include "base/a.hpp"\n\n#include <vector>\n', "src/base/a.hpp": GUARDED},
            {"src/base/main.cpp": "#include <vector>\n"},
        ],
        [
            {"src/base/a.cpp": '#include <vector>\n#include "base/a.hpp"\n', "src/base/a.hpp": GUARDED},
            {"src/base/a.cpp": "int a;\n", "src/base/a.hpp": GUARDED},
        ],
    ),
    rules.pragma_once: (
        [
            {"src/a.hpp": GUARDED, "src/a.cpp": "int a;\n"},
            {"include/gimnet/a.h": "#ifndef GIMNET_A_H\n#define GIMNET_A_H\n#endif\n"},
        ],
        [
            {"src/a.hpp": "int a;\n"},
            {"src/a.h": "#ifndef GIMNET_A_H\n#define GIMNET_A_H\n#endif\n"},
            {"include/gimnet/a.h": "int a;\n"},
        ],
    ),
    rules.file_length: (
        [{"src/a.cpp": "int a;\n" * rules.FILE_LINES_MAX}, {"docs/a.md": "a\n" * 1000}],
        [{"src/a.cpp": "int a;\n" * (rules.FILE_LINES_MAX + 1)}, {"perf/a.py": "a = 1\n" * (rules.FILE_LINES_MAX + 1)}],
    ),
    rules.line_length: (
        [{"src/a.cpp": "// " + "a" * (rules.LINE_COLUMNS_MAX - 3) + "\n"},
         {"src/a.cpp": 'const char* a = R"(\n' + "b" * 120 + '\n)";\n'},
         {"README.md": "| " + "word " * 30 + "|\n    " + "code " * 30 + "\n"}],
        [{"src/a.cpp": "// " + "a" * rules.LINE_COLUMNS_MAX + "\n"}, {"README.md": "word " * 30 + "\n"},
         {"src/a.cpp": 'const char* a = R"(\n)";\nint ' + "b" * rules.LINE_COLUMNS_MAX + ";\n"}],
    ),
    rules.function_length: (
        [
            {"src/a.cpp": long_function(rules.FUNCTION_LINES_MAX) * 2},
            {"src/a.cpp": "namespace a {\n" + "int b;\n" * 80 + "}  // namespace a\n"},
            {"src/a.hpp": "class A : public B(C) {\n public:\n" + "  int a();\n" * 80 + "};\n"},
            {"src/a.cpp": "constexpr int kTable[f(2)] = {\n" + "    1,\n" * 80 + "};\n"},
            {"tests/a.cpp": "int f() {\n  return a;\n}\n" + 'const char* a = R"(\n' + "{\n" * 80 + '}\n)";\n'},
            {"tests/a.py": "def f():\n" + "    a = 1\n" * (rules.FUNCTION_LINES_MAX - 1)},
        ],
        [
            {"src/a.cpp": long_function(rules.FUNCTION_LINES_MAX + 1)},
            {"src/a.cpp": long_function(70, "double g(int a,\n         int b) {")},
            {"src/a.cpp": long_function(70, "A::A(int a)\n    : a_(a) {")},
            {"src/a.cpp": long_function(70, 'extern "C" int f(int a) {')},
            {"src/a.hpp": "class A {\n  template <class T>\n  void f(T a) {\n" + "    a();\n" * 70 + "  }\n};\n"},
            {"src/a.cpp": "int f() {\n#if A\n" + "  if (a) {\n    b();\n  } else {\n    c();\n  }\n" * 15 + "#endif\n}\n"},
            {"src/a.cpp": 'int f() {\n  a(R"(\n}\n)");\n' + "  a();\n" * 70 + "}\n"},
            {"src/a.c": "int f(void) {\n  /* a\n}\n*/\n" + "  a();\n" * 70 + "}\n"},
            {"tests/a_test.cpp": long_function(70, "TEST(A, B) {")},
            {"tests/a.py": "def f():\n" + "    a = 1\n" * rules.FUNCTION_LINES_MAX},
        ],
    ),
    rules.memory_orders_name_their_partner: (
        [
            {"src/a.cpp": "// Pairs with the load in b().\na.store(1, std::memory_order_release);\n"},
            {"src/a.cpp": "// Pairs with b().\nint x;\nint y;\na.load(std::memory_order_acquire);\n"},
            {"src/a.cpp": "a.load(std::memory_order_relaxed);  // a counter: no partner\n"},
        ],
        [
            {"src/a.cpp": "a.store(1, std::memory_order_release);\n"},
            {"src/a.cpp": "// Too far.\nint x;\nint y;\nint z;\na.load(std::memory_order::acquire);\n"},
        ],
    ),
    rules.queues_name_their_limit: (
        [
            {"src/a.hpp": GUARDED + "std::deque<int> a_;  ///< Limit: nodes\n"},
            {"src/a.hpp": GUARDED + "/// In order.\n/// Limit: kMost\nstd::list<A<B>> a_ GIMNET_GUARDED_BY(m_);\n"},
            {"src/a.hpp": GUARDED + "  void f(std::deque<A>& a);\n  std::deque<int> g(int);\n  std::vector<int> a_;\n"},
            {"src/a.cpp": "if (a.size() == kAMax) a.erase(a.begin());\nwhile (b > limits_.x)\n  b.erase(b.begin());\n"},
            {"tests/a_test.cpp": "std::deque<int> a;\n"},
        ],
        [
            {"src/a.hpp": GUARDED + "std::deque<int> a_;\n"},
            {"src/a.hpp": GUARDED + "// Limit: of another\nint b;\nstd::list<int> a_;  ///< in order\n"},
            {"src/a.hpp": GUARDED + "using As = std::queue<int>;\n"},
            {"src/a.hpp": GUARDED + "std::deque<A> a_ GIMNET_GUARDED_BY(m_);\n"},
            {"src/a.cpp": "a.erase(a.begin());\n"},
        ],
    ),
    rules.time_and_chance_are_handed_in: (
        [
            {"src/base/clock.hpp": "auto a = std::chrono::steady_clock::now();\n"},
            {"src/hub/a.cpp": "// not steady_clock::now()\nauto a = message.time(0, 1);\nint random = brand(2);\n"},
            {"tests/a_test.cpp": "std::random_device device{};\n"},
        ],
        [
            {"src/hub/control/state/a.cpp": "auto a = std::chrono::steady_clock::now();\n"},
            {"src/client/a.cpp": "::clock_gettime(CLOCK_REALTIME, &a);\n"},
            {"src/tools/a.cpp": "auto a = std::time(nullptr);\n"},
            {"src/hub/a.cpp": "std::random_device device{};\n"},
            {"src/hub/a.cpp": "int a = rand();\n"},
            {"src/hub/a.cpp": "auto a = random_bits();\n"},
            {"src/hub/a.cpp": "std::this_thread::sleep_for(a);\n"},
        ],
    ),
    rules.no_sleeps_in_tests: (
        [{"tests/support/wait.cpp": "std::this_thread::sleep_for(a);\n"}, {"perf/a.cpp": "usleep(1);\n"}],
        [
            {"tests/a_test.cpp": "std::this_thread::sleep_for(a);\n"},
            {"tests/a_test.c": "usleep(1);\n"},
            {"tests/system/a_test.py": "time.sleep(1)\n"},
        ],
    ),
    rules.no_machine_paths: (
        [{"docs/a.md": "perf/work/a and the network/root/a\n"}],
        [{"docs/a.md": "see /work/a\n"}, {"src/a.cpp": '"/root/a"\n'}, {"dev": "cd /home/me/\n"}],
    ),
    rules.nothing_left_for_later: (
        [{"src/a.cpp": "int todos;\n"}],
        [{"src/a.cpp": "// TODO: more\n"}, {"perf/a.py": "# good enough for now\n"}],
    ),
    rules.small_headers_are_shared: (
        [
            {"src/a.hpp": "int a;\n" * 40, "src/b.cpp": '#include "a.hpp"\n'},
            {"src/a.hpp": "int a;\n" * 20, "src/a.cpp": "int b;\n" * 20, "src/b.cpp": '#include "a.hpp"\n'},
            {"src/a.hpp": ""} | {f"src/{name}.cpp": '#include "a.hpp"\n' for name in "bcd"},
        ],
        [
            {"src/a.hpp": "int a;\n" * 39, "src/b.cpp": '#include "a.hpp"\n', "src/c.cpp": '#include "a.hpp"\n'},
            {"src/a.hpp": ""} | {f"src/{name}.cpp": '#include "a.hpp"\n' for name in "abc"},
        ],
    ),
    rules.class_names_exist_once: (
        [
            {"src/a.hpp": "class A;\nstruct B {\n  class A {\n  };\n};\n", "src/b.hpp": "class A final : public B {\n};\n"},
            {"src/a.cpp": "enum class A : char { b };\n", "src/b.cpp": "// class A {\nstruct C::A {\n};\nA f() {\n}\n"},
            {"src/a.hpp": "struct A {\n};\n", "tests/a_test.cpp": "struct A {\n};\n"},
            {"src/a.hpp": "template <>\nstruct hash<A> {\n};\ntemplate <>\nstruct hash<B> {\n};\n"},
        ],
        [
            {"src/a.hpp": "class A {\n};\n", "src/b.cpp": "namespace {\nstruct A {\n};\n}\n"},
            {"src/a.hpp": "enum class A : char { b };\n", "src/b.hpp": "template <class T>\nclass A : public B<T>,\n          C {\n};\n"},
            {"src/a.hpp": "union A {\n};\n", "src/b.hpp": "template <class T> struct A {\n};\n"},
            {"src/a.hpp": "class GIMNET_CAPABILITY(\"a\") A {\n};\n", "src/b.hpp": "class GIMNET_SCOPED_CAPABILITY A {\n};\n"},
            {"src/a.hpp": "struct alignas(64) A {\n};\n", "src/b.hpp": "class [[nodiscard]] A final {\n};\n"},
        ],
    ),
    rules.class_in_one_source: (
        [
            {"src/a.cpp": "void A::f() {\n}\n\nA::A(int b)\n    : b_{b} {}\n", "src/a.hpp": "template <class T>\nT A::g() {\n}\n"},
            {"src/a.cpp": "void A::f() {\n}\n", "src/a_b.cpp": "void A::B::f() {\n}\n\nvoid C::f() {\n}\n"},
            {"src/a.cpp": "void A::f() {\n}\n", "src/b.cpp": "A b = A::c();\nvoid f() {\n  A::f();\n}\n\nA::B g() {\n}\n"},
            {"src/a.cpp": "a::B c::d() {\n}\n", "src/b.cpp": "a::B c::e() {\n}\n// void A::f() {\n"},
        ],
        [
            {"src/a.cpp": "A::A() {\n}\n", "src/b.cpp": "int A::f(int b) const {\n}\n"},
            {"src/a.cpp": "A::~A() {}\n", "src/b.cpp": "std::map<int, B>\nA::f(\n    int b) {\n}\n"},
            {"src/a.cpp": "bool A::operator==(int b) const {\n}\n", "src/b.c": "A::operator bool() {\n}\n"},
            {"src/a.hpp": "template <class T>\nvoid A<T>::f() {\n}\n", "src/a_g.hpp": "inline b::A& b::A::g() {\n}\n\nvoid A::h() {\n}\n"},
            {"src/a.cpp": "void A::B::f() {\n}\n", "src/b.cpp": "void A::B::g() {\n}\n"},
        ],
    ),
    rules.tests_mirror_sources: (
        [
            {"src/base/a.cpp": "", "tests/base/a_test.cpp": ""},
            {"src/hub/a.cpp": "", rules.UNTESTED_LIST: "# list\nsrc/hub/a.cpp: a main()\n"},
            {"src/a.cpp": "", "tests/b_test.cpp": "", rules.UNTESTED_LIST: "src/a.cpp: tests/b_test.cpp\n"},
        ],
        [
            {"src/base/a.cpp": "", "tests/a_test.cpp": ""},
            {"src/base/a.c": ""},
            {rules.UNTESTED_LIST: "src/gone.cpp: a reason\n"},
            {"src/a.cpp": "", rules.UNTESTED_LIST: "src/a.cpp:\n"},
            {"src/a.cpp": "", rules.UNTESTED_LIST: "src/a.cpp: tests/gone_test.cpp\n"},
            {"src/a.cpp": "", "tests/a_test.cpp": "", rules.UNTESTED_LIST: "src/a.cpp: main\n"},
            {rules.UNTESTED_LIST: "".join(f"src/a{n}.cpp: main\n" for n in range(rules.UNTESTED_MAX + 1))}
            | {f"src/a{n}.cpp": "" for n in range(rules.UNTESTED_MAX + 1)},
        ],
    ),
    rules.tests_are_built: (
        [{"tests/a/b_test.cpp": "", "tests/a/CMakeLists.txt": "gimnet_test(b_test.cpp DEPENDS c)\n"},
         {"tests/a/b/c_test.cpp": "", "tests/a/CMakeLists.txt": "foreach(_test d b/c)\n"}],
        [
            {"tests/a/b_test.cpp": ""},
            {"tests/a/b_test.cpp": "", "tests/a/CMakeLists.txt": "gimnet_test(b_b_test.cpp)\n"},
            {"tests/a/b_test.cpp": "", "tests/c/CMakeLists.txt": "gimnet_test(b_test.cpp)\n"},
        ],
    ),
    rules.planted_bugs_fit: (
        [{"src/a.cpp": "int a = 1;\n", rules.PLANTED_TABLE: planted_table("a_fuzz", "a=1"),
          "fuzz/CMakeLists.txt": "gimnet_fuzz(b/a_fuzz.cpp DEPENDS c)\n"},
         {"src/a.cpp": "int a = 1;\n", rules.PLANTED_TABLE: planted_table("gimnet-sim", "int  a")}],
        [
            {"src/a.cpp": "#ifdef GIMNET_BUG_A\n"},
            {"src/a.cpp": "int a = 1;\n", rules.PLANTED_TABLE: planted_table("gimnet-sim", "b")},
            {"src/a.cpp": "int a = 1, aa = 1;\n", rules.PLANTED_TABLE: planted_table("gimnet-sim", "a = 1")},
            {"src/b.cpp": "int a = 1;\n", rules.PLANTED_TABLE: planted_table("gimnet-sim", "a = 1")},
            {"src/a.cpp": "int a = 1;\n", rules.PLANTED_TABLE: planted_table("b.a_test", "a = 1")},
            {"src/a.cpp": "int a = 1;\n", rules.PLANTED_TABLE: planted_table("a_fuzz", "a = 1")},
            {"fuzz/CMakeLists.txt": "gimnet_fuzz(a_fuzz.cpp)\n"},
            {"src/a.cpp": "int a = 1;\n", rules.PLANTED_TABLE: 2 * planted_table("gimnet-sim", "a = 1")},
            {rules.PLANTED_TABLE: "[[bug]\n"},
            {rules.PLANTED_TABLE: '[[bug]]\nname = "A"\n'},
            {rules.PLANTED_TABLE: '[[bug]]\nname = "A"\nbreaks = "b"\nprogram = "gimnet-sim"\n'},
        ],
    ),
    rules.comments_open_with_their_subject: (
        [{"src/a.hpp": GUARDED + "/// The way home.\n/// What follows is more of it.\nint a;  ///< the one\n"}],
        [
            {"src/a.hpp": GUARDED + "/// What comes.\n"},
            {"src/a.hpp": GUARDED + "/** How to. */\n"},
            {"src/a.hpp": GUARDED + "int a;  ///< Where it is\n"},
        ],
    ),
    rules.links_resolve: (
        [{"README.md": "[a](docs/a.md#b), [b](https://example.org), [c](docs)\n", "docs/a.md": "[r](../README.md)\n"}],
        [{"README.md": "[a](docs/gone.md)\n"}, {"docs/a.md": "[r](README.md)\n"}],
    ),
    rules.requirements_name_tests_that_exist: (
        [
            {rules.REQUIREMENTS: "| id | what | proof |\n| R-01 | joins | open |\n"},
            {rules.REQUIREMENTS: "| I-02a | joins | `tests/a_test.cpp` (A.B) |\n", "tests/a_test.cpp": ""},
        ],
        [
            {rules.REQUIREMENTS: "| R-01 | joins | `tests/a_test.cpp` |\n"},
            {rules.REQUIREMENTS: "| R-01 | joins | |\n"},
            {rules.REQUIREMENTS: "| R-01 | joins | soon |\n"},
        ],
    ),
}


class StyleRules(unittest.TestCase):
    def violations(self, rule, files):
        with tempfile.TemporaryDirectory() as folder:
            for path, text in files.items():
                (Path(folder) / path).parent.mkdir(parents=True, exist_ok=True)
                (Path(folder) / path).write_text(text)
            return list(rule(Tree(folder)))

    def test_every_rule_has_cases(self):
        self.assertEqual(set(rules.RULES), set(CASES))

    def test_innocent_code_passes(self):
        for rule, (innocent, _) in CASES.items():
            for files in innocent:
                with self.subTest(rule=rule.__name__, files=list(files)):
                    self.assertEqual(self.violations(rule, files), [])

    def test_planted_violations_are_found_once(self):
        for rule, (_, planted) in CASES.items():
            for files in planted:
                with self.subTest(rule=rule.__name__, files=list(files)):
                    self.assertEqual(len(self.violations(rule, files)), 1, files)


if __name__ == "__main__":
    unittest.main()
