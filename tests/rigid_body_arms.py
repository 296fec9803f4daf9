"""Small arms written for tests of kinematics: their links have shapes, but neither mass nor inertia."""

LIMIT = '<limit lower="-{range}" upper="{range}" velocity="{velocity}" effort="1"/>'


def planar_arm(*lengths, kind="revolute", radius=0.05, reach=3.0, velocity=2.0, mesh=None) -> str:
    """Links along x, m, that turn about z; a sphere at each joint, `mesh` or a sphere at the `tip`."""
    parts = ['<robot name="planar">', _link("base", _sphere(radius))]
    limit = LIMIT.format(range=reach, velocity=velocity)
    for place, offset in enumerate((0.0, *lengths[:-1])):
        parent = f"link_{place - 1}" if place else "base"
        parts += [
            _link(f"link_{place}", _sphere(radius) if place else ""),
            f'<joint name="joint_{place}" type="{kind}"><parent link="{parent}"/><child link="link_{place}"/>'
            f'<origin xyz="{offset} 0 0"/><axis xyz="0 0 1"/>{limit}</joint>',
        ]
    shape = f'<mesh filename="{mesh}"/>' if mesh else _sphere(radius)
    parts += [
        _link("tip", shape),
        f'<joint name="end" type="fixed"><parent link="link_{len(lengths) - 1}"/><child link="tip"/>'
        f'<origin xyz="{lengths[-1]} 0 0"/></joint></robot>',
    ]
    return "".join(parts)


def _sphere(radius: float) -> str:
    return f'<sphere radius="{radius}"/>'


def _link(name: str, shape: str) -> str:
    collision = f"<collision><geometry>{shape}</geometry></collision>" if shape else ""
    return f'<link name="{name}">{collision}</link>'
