"""Equal areas of one machine at the critical clearing time, with a device that absorbs 0.1 pu."""

from stabctl.theory.equal_area import critical_clearing, equal_area
from stabctl.theory.omib import OMIB
from stabctl.view.figures.one_machine import plot_equal_area

machine = OMIB(H=3.0, Pm=0.5, X=0.95)
plot_equal_area(equal_area(machine, critical_clearing(machine, 0.1).angle, 0.1))
