"""The ROS 2 messages that this package writes: their types and definitions.

Definitions are those of ROS 2 without comments and constants, so that bags open in any ROS 2 tool without our
package. The one library that ships them, `rosbags`, is an extra which most have no need of.
"""

import re
from collections.abc import Mapping

from structlearn.recordings.cdr import short_name
from structlearn.recordings.recording import Kind

MESSAGE_TYPES: Mapping[Kind, str] = {
    "pose": "geometry_msgs/msg/PoseStamped",
    "twist": "geometry_msgs/msg/TwistStamped",
    "joint_positions": "sensor_msgs/msg/JointState",
    "joint_velocities": "sensor_msgs/msg/JointState",
    "joint_torques": "sensor_msgs/msg/JointState",
    "wrench": "geometry_msgs/msg/WrenchStamped",
    "tactile": "std_msgs/msg/Float32MultiArray",
    "tool_to_board": "geometry_msgs/msg/QuaternionStamped",
}
"""Type in which each kind of stream is written."""

SHAPES_TYPE = "visualization_msgs/msg/MarkerArray"
"""Type in which named shapes are written, one message for all: rviz, Foxglove and rerun draw it."""


def definition(message_type: str) -> str:
    """Text of a message definition with those of all nested types, as MCAP's `ros2msg` encoding has it."""
    names = [short_name(message_type)]
    for name in names:  # grows by the types that are met
        nested = re.findall(r"^(\w+/\w+)", _DEFINITIONS[name], re.MULTILINE)
        names += [one for one in dict.fromkeys(nested) if one not in names]
    own, *others = names
    separator = "=" * 80
    return _DEFINITIONS[own] + "".join(f"{separator}\nMSG: {one}\n{_DEFINITIONS[one]}" for one in others)


_DEFINITIONS = {
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/QuaternionStamped": "std_msgs/Header header\ngeometry_msgs/Quaternion quaternion\n",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
    "geometry_msgs/TwistStamped": "std_msgs/Header header\ngeometry_msgs/Twist twist\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
    "geometry_msgs/WrenchStamped": "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
    "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data\n",
    "sensor_msgs/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    ),
    "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n",
    "std_msgs/Float32MultiArray": "std_msgs/MultiArrayLayout layout\nfloat32[] data\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n",
    "visualization_msgs/Marker": (
        "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n"
        "geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n"
        "bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\n"
        "string texture_resource\nsensor_msgs/CompressedImage texture\n"
        "visualization_msgs/UVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\n"
        "visualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials\n"
    ),
    "visualization_msgs/MarkerArray": "visualization_msgs/Marker[] markers\n",
    "visualization_msgs/MeshFile": "string filename\nuint8[] data\n",
    "visualization_msgs/UVCoordinate": "float32 u\nfloat32 v\n",
}
