"""Speed and acceleration feedback (13), (14), solved for the power that they cause themselves.

The device slows the machine by the power P it absorbs, and P follows the acceleration a:

    M a = Pa - P,   Pa = Pm - Pe,   M = 2H/wb

so each law is solved for P in closed form. A negative acceleration gain acts as negative inertia, M + Ka < M.
"""


def speed_acceleration(speed: float, Pa: float, M: float, Kv: float, Ka: float) -> float:
    """P = Kv speed + Ka a (13), pu; speed in rad/s, Pa in pu, M in s^2/rad, Kv in pu/(rad/s), Ka in pu/(rad/s^2).

    Needs M + Ka > 0.
    """
    return Kv * speed + Ka * (Pa - Kv * speed) / (M + Ka)


def acceleration_size(side: int, Pa: float, M: float, Ka: float) -> float:
    """P = Ka |a| sgn(speed) (14), pu; `side` is the sign of the speed, the rest as in (13).

    Needs |Ka| < M, so that a has the sign of Pa.
    """
    sign = 1.0 if Pa > 0 else -1.0
    return Ka * side * sign * Pa / (M + Ka * side * sign)
