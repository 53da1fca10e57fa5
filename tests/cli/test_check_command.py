"""stabctl check, with options that change the case."""

import stabctl as st


def test_motors_do_not_hide_that_a_load_does_not_balance(stabctl, tmp_path):
    """A motor draws the power of its load at the stored voltages."""
    case = st.load("wscc9").with_load(5, p="12.5MW")
    st.write(case, tmp_path / "lighter")
    for more in ((), ("--motor-share", "30%")):
        assert "mismatch" in stabctl("check", tmp_path / "lighter", *more)[1]
