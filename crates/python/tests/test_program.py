"""``python -m barymap`` is the command line."""


def test_codes_and_words(program, tmp_path):
    assert "Usage" in program("--help").stdout
    wrong = program("transfer", "--nonsense", check=False)
    assert wrong.returncode == 2 and "--nonsense" in wrong.stderr
    missing = program("render", tmp_path / "no.obj", "-o", tmp_path / "x.png", check=False)
    assert missing.returncode == 1 and "no.obj" in missing.stderr
    import barymap

    assert barymap.__version__ in program("--version").stdout
