from .electrodes import (
    Skin as Skin,
    biotac as biotac,
    flat_pad as flat_pad,
    skin_distance as skin_distance,
    sphere as sphere,
)
from .latent_models import (
    LatentModels as LatentModels,
    StackedAutoencoders as StackedAutoencoders,
    latent_losses as latent_losses,
    read_latent_models as read_latent_models,
    write_latent_models as write_latent_models,
)
from .latent_training import train_latent_spaces as train_latent_spaces
from .servo_controller import (
    AdaptiveServo as AdaptiveServo,
    ServoParameters as ServoParameters,
    TactileServo as TactileServo,
)
from .touch_dataset import (
    TouchDataset as TouchDataset,
    read_dataset as read_dataset,
)
