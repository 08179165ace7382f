# SPDX-FileCopyrightText: The LightTransport authors
# SPDX-License-Identifier: BSD-3-Clause
"""The newcomer's scripts, with stand-ins for the programs that they call: apt is left alone where
nothing is missing, failures are told and show in the exit code, ctest's closing lines come last."""

import argparse
import os
import shutil
import subprocess
import tempfile
import unittest

parser = argparse.ArgumentParser()
parser.add_argument("--source", required=True)
source = parser.parse_args().source

PASSED = "echo '100% tests passed, 0 tests failed out of 7'\necho\necho 'Total Test time (real) = 1 sec'"
FAILED = "echo '1/2 Test #1: A ...***Failed'\necho '50% tests passed, 1 tests failed out of 2'\nexit 8"


class TestScripts(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.top = os.path.join(folder.name, "a clone")
        for name in ("Testing/test.sh", "Examples/demo.sh", "Module/packages.sh"):
            os.makedirs(os.path.dirname(os.path.join(self.top, name)), exist_ok=True)
            shutil.copy(os.path.join(source, name), os.path.join(self.top, name))
        self.bin = os.path.join(folder.name, "bin")
        os.makedirs(self.bin)
        self.called = os.path.join(folder.name, "called")
        # A bare folder of programs: only what the scripts are known to use.
        for name in "bash sh env sed grep tail cat mkdir dirname find sort rm".split():
            os.symlink(shutil.which(name), os.path.join(self.bin, name))
        self.program("dpkg-query", "echo installed")
        self.program("apt-get", f'echo apt-get "$@" >>"{self.called}"')
        self.program("id", "echo 0")
        self.program("cmake", f'echo cmake "$@" >>"{self.called}"')
        self.program("git", "echo a.cxx")
        self.program("clang-format-14", "exit 0")
        self.program("ctest", PASSED)

    def program(self, name, text):
        path = os.path.join(self.bin, name)
        with open(path, "w", encoding="utf-8") as file:
            file.write(f"#!{os.path.join(self.bin, 'bash')}\n{text}\n")
        os.chmod(path, 0o755)

    def run_script(self, script):
        done = subprocess.run(
            [os.path.join(self.bin, "bash"), os.path.join(self.top, script)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={"PATH": self.bin, "HOME": self.top},
        )
        return done.returncode, done.stdout

    def calls(self):
        if not os.path.exists(self.called):
            return ""
        with open(self.called, encoding="utf-8") as file:
            return file.read()

    def test_nothing_missing(self):
        code, text = self.run_script("Testing/test.sh")
        self.assertEqual(code, 0, text)
        self.assertNotIn("apt-get", self.calls())
        self.assertTrue(text.rstrip().endswith("Total Test time (real) = 1 sec"), text)
        self.assertIn("\n100% tests passed, 0 tests failed out of 7\n", text)

    def test_missing_package(self):
        self.program("dpkg-query", '[ "${@: -1}" != cmake ] && echo installed')
        code, text = self.run_script("Testing/test.sh")
        self.assertEqual(code, 0, text)
        self.assertRegex(self.calls(), r"apt-get .*update")
        self.assertRegex(self.calls(), r"apt-get .*install .*--no-install-recommends cmake\n")

    def test_neither_root_nor_sudo(self):
        self.program("dpkg-query", '[ "${@: -1}" != cmake ] && echo installed')
        self.program("id", "echo 1000")
        for script in ("Testing/test.sh", "Examples/demo.sh"):
            with self.subTest(script=script):
                code, text = self.run_script(script)
                self.assertNotEqual(code, 0)
                self.assertIn("not root and no sudo; install by hand: cmake", text)

    def test_sudo(self):
        self.program("dpkg-query", '[ "${@: -1}" != cmake ] && echo installed')
        self.program("id", "echo 1000")
        self.program("sudo", f'echo sudo >>"{self.called}"; exec "$@"')
        code, text = self.run_script("Testing/test.sh")
        self.assertEqual(code, 0, text)
        self.assertRegex(self.calls(), r"sudo\napt-get .*install")

    def test_apt_fails(self):
        self.program("dpkg-query", '[ "${@: -1}" != cmake ] && echo installed')
        self.program("apt-get", "echo E: no network; exit 100")
        code, text = self.run_script("Testing/test.sh")
        self.assertNotEqual(code, 0)
        self.assertIn("E: no network", text)

    def test_failing_tests(self):
        self.program("ctest", FAILED)
        code, text = self.run_script("Testing/test.sh")
        self.assertNotEqual(code, 0)
        self.assertIn("***Failed", text)
        self.assertIn("failed: ctest", text)
        self.assertTrue(text.rstrip().endswith("50% tests passed, 1 tests failed out of 2"), text)

    def test_failing_format(self):
        """A check that fails does not hide the tests' result, and counts."""
        self.program("clang-format-14", "echo a.cxx:1:1: not formatted; exit 1")
        code, text = self.run_script("Testing/test.sh")
        self.assertNotEqual(code, 0)
        self.assertIn("a.cxx:1:1: not formatted", text)
        self.assertIn("100% tests passed", text)

    def test_failing_build(self):
        self.program("cmake", "echo x.cxx:1: error: wrong; exit 1")
        for script in ("Testing/test.sh", "Examples/demo.sh"):
            with self.subTest(script=script):
                code, text = self.run_script(script)
                self.assertNotEqual(code, 0)
                self.assertIn("x.cxx:1: error: wrong", text)
                self.assertNotIn("tests passed", text)

    def test_demo(self):
        """The demo gives the program, the head and the folder on, and names what is there."""
        folder = os.path.join(self.top, "Examples", "LightVolume")
        os.makedirs(folder)
        with open(os.path.join(folder, "gallery.sh"), "w", encoding="utf-8") as file:
            file.write('echo "$1" >"$3/arguments"\necho "$2" >>"$3/arguments"\n')
        code, text = self.run_script("Examples/demo.sh")
        self.assertEqual(code, 0, text)
        self.assertTrue(text.rstrip().endswith("gallery/arguments"), text)
        with open(os.path.join(self.top, "gallery", "arguments"), encoding="utf-8") as file:
            arguments = file.read()
        self.assertIn("build/release/bin/light-volume\n", arguments)
        self.assertIn("/ch2.nii.gz\n", arguments)
        self.assertNotIn("apt-get", self.calls())

        # Again: lit only if something changed or a picture is gone.
        code, text = self.run_script("Examples/demo.sh")
        self.assertEqual(code, 0, text)
        self.assertIn("nothing changed", text)
        self.assertTrue(text.rstrip().endswith("gallery/arguments"), text)
        os.remove(os.path.join(self.top, "gallery", "arguments"))
        code, text = self.run_script("Examples/demo.sh")
        self.assertEqual(code, 0, text)
        self.assertNotIn("nothing changed", text)
        self.assertTrue(os.path.exists(os.path.join(self.top, "gallery", "arguments")))


if __name__ == "__main__":
    unittest.main(argv=["TestScripts"])
