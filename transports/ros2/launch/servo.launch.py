"""The loop with an arm: ros2 launch lapservo servo.launch.py rig:=rig.yaml arm:=PSM1 joint_limits:=psm.yaml enable_motion:=true"""
import shlex

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration


def start(context):
    def argument(name):
        return LaunchConfiguration(name).perform(context)

    def resolved(name):  # as ROS 2 does: a name that begins with / stands in no namespace
        return name if name.startswith('/') else f"{argument('namespace').rstrip('/')}/{name}"

    moving = ['--enable-motion'] if argument('enable_motion') == 'true' else []
    if argument('joint_limits'):
        moving += ['--joint-limits', argument('joint_limits')]
    return [ExecuteProcess(
        cmd=['lapservo', 'servo', '--rig', argument('rig'), '--robot', 'ros2:' + resolved(argument('arm')),
             '--camera', 'ros2:' + resolved(argument('image')), *moving, *shlex.split(argument('options'))],
        output='screen', sigterm_timeout='15')]


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument('rig', description='Camera and instruments: a YAML file'),
        DeclareLaunchArgument('namespace', default_value='', description='Stands before names that do not begin with /'),
        DeclareLaunchArgument('arm', default_value='PSM1', description="Namespace of the arm's CRTK topics"),
        DeclareLaunchArgument('image', default_value='endoscope/image_raw', description='Topic of the images'),
        DeclareLaunchArgument('enable_motion', default_value='false', choices=['true', 'false'],
                              description='Whether setpoints are sent; else the loop only watches'),
        DeclareLaunchArgument('joint_limits', default_value='', description="The arm's limits, needed for motion: a YAML file"),
        DeclareLaunchArgument('options', default_value='', description='More options, as lapservo servo --help has them'),
        OpaqueFunction(function=start),
    ])
